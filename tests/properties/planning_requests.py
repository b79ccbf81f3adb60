"""Requests for plans of shapes, and for the parameters of ropes."""

from __future__ import annotations

from hypothesis import strategies as st

from tests.properties.numbers import either, number, polyline
from tests.properties.request_parts import Request, homography, picture


@st.composite
def experience(draw: st.DrawFn, size: float) -> Request:
    before, shift = draw(polyline(2, size, 20)), number(-0.05, 0.05)
    action = {
        "edge": draw(st.integers(0, max(len(before) - 1, 0))),
        "dx_m": draw(shift),
        "dy_m": draw(shift),
        "dtheta_rad": draw(number(-0.7, 0.7)),
    }
    after = (
        [[x + 0.01, y + 0.01] for x, y in before]
        if draw(st.booleans())
        else draw(polyline(2, size, 20))
    )
    return {"before": before, "action": action, "after": after}


@st.composite
def limits(draw: st.DrawFn) -> Request:
    asked: Request = {}
    if draw(st.booleans()):
        low, high = -abs(draw(number(0.2, 0.6))), abs(draw(number(0.2, 0.6)))
        asked["workspace_m"] = [[low, low], [high, high]]
    if draw(st.booleans()):
        asked["keep_out_m"] = [draw(polyline(2, 0.1, 6))]
    if draw(st.booleans()):
        asked |= {
            "base_xy_m": [draw(number(-1, 1)), 0.0],
            "reach_m": [draw(number(0, 0.1)), draw(number(0.5, 2))],
        }
    if draw(st.booleans()):
        asked["max_displacement_m"], asked["max_rotation_rad"] = (
            draw(number(0.01, 0.1)),
            draw(number(0, 0.785)),
        )
    if draw(st.booleans()):
        asked["no_grasp_edges"] = draw(st.lists(st.integers(0, 40), max_size=40))
    return asked


def dlo() -> st.SearchStrategy[Request]:
    return st.fixed_dictionaries(
        {"mass_kg": number(0.02, 0.1)}, optional={"length_m": number(0.2, 0.5)}
    )


@st.composite
def fixed(draw: st.DrawFn) -> Request:
    """Fixtures, and often a route by some of them."""
    place = st.tuples(number(-0.2, 0.5), number(-0.3, 0.3)).map(list)
    peg = st.fixed_dictionaries(
        {"kind": st.just("peg"), "xy_m": place, "radius_m": number(0.002, 0.05)}
    )
    wall = st.fixed_dictionaries({"kind": st.just("edge"), "from_m": place, "to_m": place})
    clip = st.fixed_dictionaries(
        {
            "kind": st.just("clip"),
            "xy_m": place,
            "angle_rad": number(-3, 3),
            "width_m": number(0.006, 0.03),
        },
        optional={"length_m": number(0.005, 0.05)},
    )
    found = draw(st.lists(st.one_of(peg, clip, wall), min_size=1, max_size=4))
    asked: Request = {"fixtures": found}
    if draw(st.booleans()):
        asked["gripper"] = {"width_m": draw(number(0, 0.05))}
    stops = [
        {"fixture": k}
        | ({"side": draw(st.sampled_from(["left", "right"]))} if f["kind"] == "peg" else {})
        for k, f in enumerate(found)
        if f["kind"] != "edge"
    ]
    if stops and draw(st.integers(0, 3)):
        asked["route"] = {"stops": draw(st.permutations(stops))} | draw(
            st.fixed_dictionaries({}, optional={"end_m": place})
        )
    return asked


@st.composite
def plan_shape(draw: st.DrawFn) -> Request:
    asked: Request = {
        "target_m": draw(polyline(2, 0.4)),
        "object": draw(dlo()),
        "limits": draw(limits()),
    }
    if draw(st.integers(0, 3)):
        asked["state_m"] = draw(polyline(2, 0.4))
    else:
        asked |= {"image": draw(picture()), "homography": draw(homography())}
    if draw(st.booleans()):
        asked["parameters"] = {"k_b": draw(number(0.05, 1)), "k_d": draw(number(3, 30))}
    elif draw(st.booleans()):
        asked["history"] = draw(st.lists(experience(0.4), max_size=5))
        asked["tried"] = draw(st.integers(0, 6))
    if draw(st.integers(0, 2)) == 0:
        asked |= draw(fixed())
        if "route" in asked:
            del asked["target_m"]
    return asked | {
        "horizon": draw(either(st.sampled_from([1, 2]), st.sampled_from([1, 1, 4, 5]))),
        "tolerance_m": draw(number(0.001, 0.02)),
        "scale_target": draw(st.booleans()),
        "alternatives": draw(either(st.integers(0, 14), st.sampled_from([0, 3, 15]))),
        "valid_for_s": draw(number(1, 10)),
    }


def estimate_parameters() -> st.SearchStrategy[Request]:
    return st.fixed_dictionaries(
        {
            "history": either(
                st.lists(experience(0.4), min_size=1, max_size=4),
                st.lists(experience(0.4), max_size=2),
            ),
            "object": dlo(),
        }
    )
