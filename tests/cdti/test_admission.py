"""One page decides, the others watch, and who does not know the address is not let in."""

from components.cdti.page import OPERATOR, WATCHER, Admission


def test_the_first_page_decides_and_the_second_watches():
    door = Admission()
    role, key = door.role(door.token, "")
    assert role == OPERATOR and len(key) >= 32
    assert door.role(door.token, "") == (WATCHER, "")
    assert door.role(door.token, "guess") == (WATCHER, "")
    assert door.role(door.token, key) == (OPERATOR, key)  # the same page, loaded again


def test_a_token_is_of_one_run_and_not_to_be_guessed():
    door, other = Admission(), Admission()
    assert door.knows(door.token) and not door.knows(other.token)
    assert not door.knows("") and not door.knows(door.token[:-1]) and not door.knows("\udcff")
    assert len(door.token) >= 32


def test_a_new_address_decides_where_the_old_one_no_longer_does():
    door = Admission()
    old = door.token
    assert door.renew() == old  # nobody has come yet
    _, key = door.role(old, "")
    new = door.renew()
    assert new != old and door.renew() == new
    assert door.role(old, "") == (WATCHER, "")
    assert door.role(new, "")[0] == OPERATOR
    assert door.role(old, key) == (WATCHER, "")  # who comes back late has lost its place
    assert door.knows(old) and door.knows(new)
