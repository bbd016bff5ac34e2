"""What carries each block of a scene: an aircraft, or a place, that another block moves."""

from collections.abc import Mapping, Sequence

from dsa_des.errors import Problem, SceneError, did_you_mean
from dsa_des.scene.scene import Scene


def platform_by_block(scene: Scene, moved: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """Return block → its platform: the one its table names, or else that of its feeding blocks.

    `moved` is what some blocks move (`Component.platforms`); these are on none themselves. A block
    that nothing but they feed is on the first of it, if its table says nothing. What comes over
    inputs between platforms (`Input.between_platforms`) says it where nothing else does. A
    `SceneError` refuses a name that there is not, and a block that is fed from two platforms.
    """
    known = [name for names in moved.values() for name in names]
    if len(known) < 2 and all(one.options.platform is None for one in scene.blocks.values()):
        return dict.fromkeys(sorted(scene.blocks.keys() - moved.keys()), next(iter(known), ""))
    near = {name: _feeding_blocks(scene, name, between=False) for name in scene.blocks}
    far = {name: _feeding_blocks(scene, name, between=True) for name in scene.blocks}
    carrying: dict[str, str] = {}
    problems: list[Problem] = []
    for name, block in scene.blocks.items():
        said, feeding = block.options.platform, near[name] + far[name]
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
        found = _platforms_from_feeders(left, near, carrying) or _platforms_from_feeders(
            [name for name in left if moved.keys() >= set(near[name])], far, carrying
        )
        # What no chain reaches is on the first of all.
        carrying |= found or dict.fromkeys(left, next(iter(known), ""))
        left = [name for name in left if name not in carrying]
    for name in sorted(carrying):
        mine, feeders = carrying[name], _first_block_by_platform(near[name], carrying)
        is_settled = bool(feeders) or scene.blocks[name].options.platform is not None
        feeders = feeders if is_settled else _first_block_by_platform(far[name], carrying)
        for other in sorted(feeders.keys() - {mine}):
            by = f"{feeders[mine]} feeds it" if mine in feeders else "its key platform says"
            how = "a block looks from one place; give each platform one of its own"
            if mine not in feeders:
                how += ", and say which at the first block of its chain"
            if not is_settled:
                how = f"which of them it is on, its table must say (platform = {mine!r})"
            message = (
                f"is carried by {mine!r}, as {by}, and {feeders[other]} on {other!r} feeds it too: "
                f"{how}"
            )
            problems.append(scene.problem(f"blocks.{name}", message))
    if problems:
        raise SceneError(problems)
    return carrying


def _feeding_blocks(scene: Scene, name: str, *, between: bool) -> list[str]:
    """Return feeders of `name`'s inputs between platforms, or of the others if not `between`."""
    inputs = scene.blocks[name].cls.inputs
    return [
        wire.source
        for wire in scene.wires
        if wire.target == name and inputs[wire.input].between_platforms == between
    ]


def _platforms_from_feeders(
    names: Sequence[str], feeding: Mapping[str, Sequence[str]], carrying: Mapping[str, str]
) -> dict[str, str]:
    """Return block → platform, for those blocks that have a feeder on a known platform."""
    carried = {name: _first_block_by_platform(feeding[name], carrying) for name in names}
    return {name: min(feeders) for name, feeders in carried.items() if feeders}


def _first_block_by_platform(sources: Sequence[str], carrying: Mapping[str, str]) -> dict[str, str]:
    """Return platform → the first of the given blocks that it carries."""
    found: dict[str, str] = {}
    for source in sources:
        if source in carrying:
            found.setdefault(carrying[source], source)
    return found


def _explain_no_platform(scene: Scene, name: str, known: Sequence[str] | None) -> Problem:
    """Return what is wrong with a block's platform; `known` is None if it moves the platforms."""
    said = scene.blocks[name].options.platform or ""
    if known is None:
        why = "it moves all platforms and is on none: name it at the blocks that look from it"
    elif known:
        why = f"there is no such aircraft or place{did_you_mean(said, known)}"
    else:
        why = "no block of this scene says which aircraft there are"
    return scene.problem_of_setup_refusal(name, f"platform: {why}")
