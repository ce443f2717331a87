"""An answer is remembered for the last record, and holds nothing."""

from weakref import ref

from truenorth.core.remembered import remembered


class Thing:
    """What can be referred to weakly."""


def test_it_is_worked_out_once_for_each_in_turn():
    asked = []
    answer = remembered(lambda thing: asked.append(thing) or len(asked))
    one, other = Thing(), Thing()
    assert [answer(one), answer(one), answer(other), answer(other), answer(one)] == [1, 1, 2, 2, 3]


def test_it_does_not_keep_what_it_was_asked_of():
    answer = remembered(lambda thing: 1)
    thing = Thing()
    answer(thing)
    gone = ref(thing)
    del thing
    assert gone() is None
