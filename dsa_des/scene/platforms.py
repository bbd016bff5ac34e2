"""What carries each block of a scene: an aircraft, or a place, that another block moves."""

from collections.abc import Mapping, Sequence

from dsa_des.errors import Problem, SceneError, did_you_mean
from dsa_des.scene.scene import Scene


def platforms_of(scene: Scene, moved: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """Return what carries each block, by name: what its table says, or what carries its feeders.

    `moved` is what some blocks move (`Component.platforms`); these are on none themselves. A block
    that nothing but they feed is on the first of it, if its table says nothing. A `SceneError`
    refuses a name that there is not, and a block that is fed from two platforms.
    """
    known = [name for names in moved.values() for name in names]
    carrying: dict[str, str] = {}
    problems: list[Problem] = []
    for name, block in scene.blocks.items():
        feeding = [
            wire.source
            for wire in scene.wires
            if wire.target == name and not block.cls.inputs[wire.input].between_platforms
        ]
        said = block.options.platform
        if said is not None and (said not in known or name in moved):
            problems.append(_explain_no_platform(scene, name, known if name not in moved else None))
        elif said is not None:
            carrying[name] = said
        elif name not in moved and feeding and all(source in moved for source in feeding):
            carrying[name] = moved[feeding[0]][0]
    if problems:
        raise SceneError(problems)
    left = sorted(scene.blocks.keys() - moved.keys() - carrying.keys())
    while left:  # down the chains, around loops too
        fed = {name: _feeding(scene, name, carrying) for name in left}
        found = {name: min(feeders) for name, feeders in fed.items() if feeders}
        # What no chain reaches is on the first of all.
        carrying |= found or dict.fromkeys(left, next(iter(known), ""))
        left = [name for name in left if name not in carrying]
    for name in sorted(carrying):
        mine, feeders = carrying[name], _feeding(scene, name, carrying)
        for other in sorted(feeders.keys() - {mine}):
            by = f"{feeders[mine]} feeds it" if mine in feeders else "its key platform says"
            how = "give each platform one of its own"
            if mine not in feeders:
                how += ", and say which at the first block of its chain"
            message = (
                f"is carried by {mine!r}, as {by}, and {feeders[other]} on {other!r} feeds it too: "
                f"a block looks from one place; {how}"
            )
            problems.append(scene.problem(f"blocks.{name}", message))
    if problems:
        raise SceneError(problems)
    return carrying


def _feeding(scene: Scene, name: str, carrying: Mapping[str, str]) -> dict[str, str]:
    """Return what carries the blocks that feed one, with the first of these on each."""
    found: dict[str, str] = {}
    inputs = scene.blocks[name].cls.inputs
    for wire in scene.wires:
        between = wire.target == name and inputs[wire.input].between_platforms
        if wire.target == name and wire.source in carrying and not between:
            found.setdefault(carrying[wire.source], wire.source)
    return found


def _explain_no_platform(scene: Scene, name: str, known: Sequence[str] | None) -> Problem:
    """Return why what a block's table names cannot carry it; `known` is None of who moves all."""
    said = scene.blocks[name].options.platform or ""
    if known is None:
        why = "it moves all platforms and is on none: name it at the blocks that look from it"
    elif known:
        why = f"there is no such aircraft or place{did_you_mean(said, known)}"
    else:
        why = "no block of this scene says which aircraft there are"
    return scene.setup_refusal(name, f"platform: {why}")
