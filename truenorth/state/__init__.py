"""What every procedure shares: the state of a vehicle, its track, how error states are laid out, how sensors sit; and the judge."""
