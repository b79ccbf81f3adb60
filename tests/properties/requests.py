"""A strategy for each job kind: requests as they come out of JSON, with ``{"picture": name}`` where
a picture goes."""

from __future__ import annotations

from hypothesis import strategies as st

from tests.properties.numbers import either, number, optional, polyline, pose
from tests.properties.pictures import SIZE
from tests.properties.planning_requests import estimate_parameters, plan_shape
from tests.properties.request_parts import OF_ONE_SIZE, Request, picture


def noop() -> st.SearchStrategy[Request]:
    return st.fixed_dictionaries({"hold_s": st.sampled_from([0, 0.001, -1, 61, 1e-300, 1e300])})


def segment() -> st.SearchStrategy[Request]:
    more = {
        "threshold": number(0, 1),
        "regions": regions(),
        "reference": st.lists(picture(), max_size=2),
    }
    return st.fixed_dictionaries({"image": picture()}, optional=more)


def regions() -> st.SearchStrategy[Request]:
    """Polygons in, around and beside the picture, of any shape."""
    polygons = st.lists(polyline(2, 120, 6), max_size=3)
    return st.fixed_dictionaries({}, optional={"only": polygons, "never": polygons})


@st.composite
def instances(draw: st.DrawFn) -> Request:
    asked: Request = {draw(st.sampled_from(["image", "mask"])): draw(picture())}
    method = draw(st.sampled_from(["section_matching", "rt_dlo", "fastdlo", "ariadne_plus"]))
    params = {
        "section_matching": {"hole_widths": (0, 4), "gap_widths": (0, 50), "stop_cost": (-5, 20)},
        "rt_dlo": {"sampling_ratio": (0, 1), "min_similarity": (0, 1)},
        "fastdlo": {"min_probability": (0, 1)},
        "ariadne_plus": {},
    }[method]
    asked["params"] = {
        name: draw(number(*span)) for name, span in params.items() if draw(st.booleans())
    }
    if method == "ariadne_plus":
        asked["params"]["superpixels"] = draw(st.integers(0, 401))
    if method == "rt_dlo":
        asked["params"]["neighbors"] = draw(st.integers(1, 65))
    asked |= {"method": method, "points_per_instance": draw(optional(st.integers(1, 2001)))}
    if draw(st.booleans()):
        asked["threshold"] = draw(number(0, 1))
    if draw(st.integers(0, 3)) == 0:
        asked |= {
            "regions": draw(regions()),
            "reference": draw(st.lists(picture(OF_ONE_SIZE), max_size=2)),
        }
    return asked


@st.composite
def intrinsics(draw: st.DrawFn) -> Request:
    width, height = SIZE
    focal, middle = number(80, 120), (number(40, 56), number(30, 42))
    lens = draw(st.sampled_from(["plumb_bob", "plumb_bob", "rational_polynomial", "equidistant"]))
    count = draw(
        st.sampled_from(
            {"plumb_bob": [0, 0, 4, 5], "equidistant": [0, 4]}.get(lens, [0, 8, 12, 14, 3])
        )
    )
    bends = [draw(number(-0.1, 0.1)) for _ in range(count)]
    fx, fy, cx, cy = draw(focal), draw(focal), draw(middle[0]), draw(middle[1])
    if draw(st.booleans()):
        return {
            "width": width,
            "height": height,
            "fx": fx,
            "fy": fy,
            "cx": cx,
            "cy": cy,
            "distortion": bends,
            "distortion_model": lens,
        }
    odd = {
        "binning_x": draw(st.sampled_from([0, 1, 2, 65])),
        "roi": {"width": draw(st.integers(0, 97)), "height": 72},
    }
    info = {
        "width": width,
        "height": height,
        "K": [fx, 0, cx, 0, fy, cy, 0, 0, 1],
        "D": bends,
        "distortion_model": lens,
    }
    return info | draw(either(st.just({}), st.sampled_from([{}, odd])))


def camera() -> st.SearchStrategy[Request]:
    return st.fixed_dictionaries({"intrinsics": intrinsics(), "T_world_camera": pose()})


def views(least: int, most: int) -> st.SearchStrategy[list[Request]]:
    one = st.builds(lambda c, p: c | {"image": p}, camera(), picture(OF_ONE_SIZE))
    return st.lists(one, min_size=least, max_size=most)


@st.composite
def slide(draw: st.DrawFn) -> list[Request]:
    """Three pictures of one cable from a camera that slides, by about so much, or turns, or does
    not move."""
    step = draw(st.sampled_from([-0.02, -0.02, -0.02, 0.02, 1e-4, 1e-6, 1.0, 0.0]))
    depth, lens = draw(number(0.25, 0.4, 0.1)), draw(intrinsics())
    name = draw(st.sampled_from(["slide", "slide", "row"]))
    order = draw(st.permutations(range(3)))
    made = []
    for k in range(3):
        place = [
            [1, 0, 0, step * k],
            [0, -1, 0, draw(number(-1e-3, 1e-3))],
            [0, 0, -1, depth],
            [0, 0, 0, 1],
        ]
        made.append(
            {"intrinsics": lens, "T_world_camera": place, "image": {"picture": f"{name}{order[k]}"}}
        )
    return made[: draw(st.sampled_from([2, 3, 3]))]


@st.composite
def curve(draw: st.DrawFn) -> Request:
    points = draw(polyline(3, 0.3))
    degree, count = draw(st.sampled_from([3, 3, 3, 3, 2])), draw(st.integers(4, 9))
    spans = count - degree
    even = st.just([k / spans for k in range(1, spans)])
    inner = draw(either(even, st.lists(number(0, 1, 0.02), min_size=spans - 1, max_size=spans - 1)))
    knots = sorted([0.0] * (degree + 1) + inner + [1.0] * (degree + 1))
    if draw(either(st.just(False), st.booleans())):
        knots = [draw(number(0, 1))] * len(knots)
    control = draw(polyline(3, 0.3, count))
    control = (control * count)[:count]
    spread, sigma = draw(number(0, 1e-6)), draw(number(0, 1e-3))
    return {
        "points_m": points,
        "covariance_m2": [[spread, 0, 0, spread, 0, spread]] * len(points),
        "sigma_m": [sigma] * len(points),
        "spline": {"degree": degree, "knots": knots, "control_m": control},
        "radius_m": draw(optional(number(0.001, 0.01))),
        "length_m": draw(number(0.2, 0.4)),
    }


@st.composite
def reconstruct(draw: st.DrawFn) -> Request:
    asked: Request = {
        "views": draw(st.one_of(slide(), slide(), views(2, 3))),
        "method": draw(st.sampled_from(["spline_bundle", "dlo3ds"])),
    }
    if draw(st.integers(0, 3)) == 0:
        asked["target"] = {
            "view": draw(st.integers(0, 3)),
            "xy": [draw(number(0, 96)), draw(number(0, 72))],
        }
    if draw(st.integers(0, 3)) == 0:
        asked["previous"] = draw(curve())
    return asked | {
        "points": draw(either(st.sampled_from([4, 20, 60, 1000]), st.sampled_from([20, 60, 3])))
    }


def next_view() -> st.SearchStrategy[Request]:
    span = st.tuples(number(-0.5, 0), number(0, 0.5)).map(list)
    return st.fixed_dictionaries(
        {"curve": curve(), "cameras": st.lists(camera(), min_size=1, max_size=3)},
        optional={
            "pictures": either(st.integers(2, 16), st.integers(1, 17)),
            "optimise": st.sampled_from(["fixed", "b", "z", "bz"]),
            "baseline_m": number(0.01, 0.1),
            "baseline_at_most_m": number(0.01, 1),
            "nearest_m": number(0.05, 0.2),
            "delta_z_m": span,
            "margin_px": number(0, 20),
            "advance": st.booleans(),
            "overlap": number(0.05, 0.9),
        },
    )


def merge_curves() -> st.SearchStrategy[Request]:
    return st.fixed_dictionaries(
        {"curves": st.lists(curve(), min_size=1, max_size=4)},
        optional={"window_m": number(0.01, 0.1), "spacing_m": number(0.001, 0.02)},
    )


@st.composite
def drawing(draw: st.DrawFn) -> Request:
    count = draw(st.integers(1, 9))
    branches = [
        {
            "name": f"b{k}",
            "a": f"p{draw(st.integers(0, k))}",
            "b": f"p{k + 1}",
            "length": draw(number(10, 200)),
        }
        for k in range(count)
    ]
    asked: Request = {
        "branches": branches,
        "connectors": draw(st.lists(st.sampled_from(["p1", "p2", "x"]), max_size=2)),
    }
    return asked | {"px_per_unit": draw(optional(number(0.1, 10)))}


def _points() -> st.SearchStrategy[list[Request]]:
    one = st.builds(
        lambda x, y, z: {"xy": [x, y], "depth_m": z}, number(0, 96), number(0, 72), number(0.2, 0.6)
    )
    return st.lists(one, max_size=12)


@st.composite
def topology(draw: st.DrawFn) -> Request:
    asked: Request = {draw(st.sampled_from(["image", "mask", "mask"])): draw(picture())}
    if draw(st.integers(0, 2)) == 0:
        asked["drawing"] = draw(drawing())
    match draw(st.integers(0, 5)):
        case 0:
            asked["depth"] = draw(picture(("depth", "cable")))
        case 1:
            asked["points"] = draw(_points())
    return asked | ({"threshold": draw(number(0, 1))} if draw(st.booleans()) else {})


@st.composite
def _section(draw: st.DrawFn, number_: int, sections: int, branch_points: int) -> Request:
    ends = st.sampled_from(["branch", "free", "border"])
    ids = optional(st.integers(1, branch_points)) if branch_points else st.none()
    points = draw(polyline(2, 60, 12))
    return {
        "id": number_,
        "points_xy": [[x + 40, y + 30] for x, y in points],
        "width_px": draw(number(2, 8)),
        "length_px": draw(number(20, 90)),
        "end_widths_px": [draw(number(2, 8)), draw(number(2, 8))],
        "ends": [draw(ends), draw(ends)],
        "branch_points": [draw(ids), draw(ids)],
        "closed": draw(st.booleans()),
        "score": draw(number(0, 1)),
    }


@st.composite
def harness(draw: st.DrawFn) -> Request:
    """A topology as it travels, not necessarily one that could be."""
    sections, branch_points = draw(st.integers(0, 6)), draw(st.integers(0, 3))
    spot = st.tuples(number(0, 96), number(0, 72)).map(list)
    which, share = st.integers(1, max(sections, 1)), number(0, 1)
    place = st.fixed_dictionaries({"section": which, "u": share})
    crossing = st.fixed_dictionaries(
        {"xy": spot, "over": place, "under": place, "score": share, "order_score": share}
    )
    branch = st.fixed_dictionaries(
        {"xy": spot, "sections": st.lists(which, max_size=4), "score": share}
    )
    many = draw(st.lists(branch, min_size=branch_points, max_size=branch_points))
    return {
        "width": draw(st.sampled_from([96, 96, 96, 1, 100_000])),
        "height": draw(st.sampled_from([72, 72, 1, 100_000])),
        "sections": [draw(_section(k + 1, sections, branch_points)) for k in range(sections)],
        "branch_points": [{"id": k + 1, **b} for k, b in enumerate(many)],
        "crossings": [
            {"id": k + 1, **c} for k, c in enumerate(draw(st.lists(crossing, max_size=4)))
        ],
    }


@st.composite
def plan_disentangle(draw: st.DrawFn) -> Request:
    asked: Request = (
        {"topology": draw(harness())} if draw(st.integers(0, 4)) else {"mask": draw(picture())}
    )
    if draw(st.booleans()):
        base = st.tuples(number(-50, 150), number(-50, 150), optional(number(10, 300)))
        arms = draw(st.lists(base, min_size=1, max_size=3))
        asked["arms"] = [
            {"name": f"a{k}", "xy": [x, y], "reach_px": r} for k, (x, y, r) in enumerate(arms)
        ]
    if draw(st.booleans()):
        hold = {"xy": [draw(number(-50, 150)), draw(number(-50, 150))], "angle_rad": 0.0}
        done = {
            "hold": hold,
            "turn_rad": draw(number(-3, 3)),
            "crossings_after": 0,
            "score": draw(number(0, 1)),
        }
        asked["attempts"] = [
            {"action": done, "crossings": k} for k in range(draw(st.integers(0, 3)))
        ]
    return asked | {
        "margin_px": draw(number(0, 40)),
        "at_most": draw(either(st.integers(1, 50), st.sampled_from([0, 3, 51]))),
    }


@st.composite
def label_tracked(draw: st.DrawFn) -> Request:
    stroke = st.fixed_dictionaries(
        {"points_m": polyline(3, 0.2, 20), "thickness_m": number(0.002, 0.02)}
    )
    asked: Request = {
        "views": draw(views(1, 2)),
        "strokes": draw(st.lists(stroke, min_size=1, max_size=3)),
    }
    if draw(st.integers(0, 4)) == 0:
        asked["T_world_tracker"] = draw(pose())
    for switch in ("correct", "agree", "measure_width", "find_ends"):
        asked[switch] = draw(st.booleans())
    return asked | {"spacing_px": draw(number(2, 50))}


KINDS: dict[str, st.SearchStrategy[Request]] = {
    "noop": noop(),
    "segment": segment(),
    "instances": instances(),
    "reconstruct": reconstruct(),
    "next_view": next_view(),
    "merge_curves": merge_curves(),
    "topology": topology(),
    "plan_disentangle": plan_disentangle(),
    "plan_shape": plan_shape(),
    "estimate_parameters": estimate_parameters(),
    "label_tracked": label_tracked(),
}
