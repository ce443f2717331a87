"""Which options of `truenorth align` go together: one procedure at a time, and what belongs to another one is not passed over."""

from __future__ import annotations

import typer

from truenorth.core.errors import UsageError

PROCEDURES = {
    "--positions": "a turntable",
    "--indexer": "an IMU on an indexer",
    "--master": "a master INS",
    "--odometer": "a vehicle on the move",
    "--gnss": "a vehicle on the move",
    "--velocity": "a vehicle on the move",
}
MOVING = ("--odometer", "--gnss", "--velocity")
BELONGS = {
    "--arm-sigma": ("--positions",),
    "--indexer-axes": ("--indexer",),
    "--indexer-sigma": ("--indexer",),
    "--lever-arm": ("--indexer", "--master"),
    "--lever-arm-sigma": ("--master",),
    "--master-columns": ("--master",),
    "--master-units": ("--master",),
    "--matching": ("--master",),
    "--delay": ("--master",),
    "--flexure": ("--master",),
    "--log-kind": ("--velocity",),
    "--offset": MOVING,
    "--wheel-arm": ("--odometer", "--velocity"),
    "--attitude": MOVING,
    "--attitude-sigma": ("--attitude",),
    "--attitude-mounting": ("--attitude",),
    "--magnetometer": MOVING,
    "--magnetometer-axes": ("--magnetometer",),
    "--magnetometer-iron": ("--magnetometer",),
    "--date": ("--magnetometer",),
    "--baseline": ("--gnss",),
    "--odometer-noise": ("--odometer",),
    "--antenna-arm": ("--gnss",),
    "--error": MOVING,
    "--latency": ("--gnss",),
    "--mounting": (*MOVING, "--master"),
    "--mounting-sigma": (*MOVING, "--master"),
}
CLASHES = {
    "--method": ("--positions", "--master"),
    "--at": ("--positions", "--master", *MOVING),
    "--advise": ("--master", *MOVING),
}
INSTEAD = {
    "--method": "leave it out: the procedure has a method of its own",
    "--at": "the attitude holds at the log's end: cut the log with --to",
    "--advise": "its positions are for a base that stays: ask truenorth advise, with --speed for a vehicle with a master INS",
}


def check_options(context: typer.Context) -> None:
    """Refuse options of two procedures, of another procedure, and those that a procedure would not look at.

    Raises
    ------
    UsageError
        It names both options, and what to do.
    """
    given = [p.opts[0] for p in context.command.params if p.name and context.params[p.name] not in (p.default, [], ())]
    chosen = [option for option in given if option in PROCEDURES]
    for option in chosen[1:]:
        if PROCEDURES[option] != PROCEDURES[chosen[0]]:
            raise UsageError(
                f"{chosen[0]} ({PROCEDURES[chosen[0]]}) and {option} ({PROCEDURES[option]}) are two procedures; expected one: "
                "align with each, in two calls"
            )
    for option, homes in BELONGS.items():
        if option in given and not set(homes) & set(given):
            raise UsageError(f"{option} belongs to {' or '.join(homes)}; expected it along with that, or not at all")
    for option, others in CLASHES.items():
        clash = [other for other in chosen if other in others]
        if option in given and clash:
            raise UsageError(f"{option} does not go with {clash[0]}; {INSTEAD[option]}")
