"""Changes the links of a URDF at random, and tells what they weigh then: masses, centres and tensors that can exist."""

from xml.etree import ElementTree

import numpy as np


def numbers(text):
    return np.array([float(word) for word in text.split()])


def inertials(root):
    """Mass, centre of mass in the link's frame, tensor about it in the link's axes, by link; links without are left out."""
    found = {}
    for link in root.findall("link"):
        own = link.find("inertial")
        if own is None:
            continue
        origin = own.find("origin")
        turned = numbers(origin.get("rpy", "0 0 0")) if origin is not None else np.zeros(3)
        assert np.all(turned == 0.0), f"{link.get('name')}: its inertial is turned, which is not handled here"
        e = {key: float(value) for key, value in own.find("inertia").attrib.items()}
        tensor = np.array(
            [[e["ixx"], e["ixy"], e["ixz"]], [e["ixy"], e["iyy"], e["iyz"]], [e["ixz"], e["iyz"], e["izz"]]]
        )
        centre = numbers(origin.get("xyz")) if origin is not None else np.zeros(3)
        found[link.get("name")] = (float(own.find("mass").get("value")), centre, tensor)
    return found


def changed(inertial, scale, shift, stretch):
    """The body whose every point is moved by `stretch` about the centre of mass, then by `shift`, its density scaled:
    where the first can exist, so can this one."""
    mass, centre, tensor = inertial
    second = 0.5 * np.trace(tensor) * np.eye(3) - tensor
    second = scale * stretch @ second @ stretch.T
    return scale * mass, centre + shift, np.trace(second) * np.eye(3) - second


def draw(rng):
    """Up to 20 % of mass, up to 10 mm of the centre, up to 5 % of lengths with shear."""
    shift = rng.normal(size=3)
    shift *= 0.010 * rng.uniform() ** (1 / 3) / np.linalg.norm(shift)
    wide = rng.uniform(-0.05, 0.05, (3, 3))
    return 1.0 + rng.uniform(-0.2, 0.2), shift, np.eye(3) + 0.5 * (wide + wide.T)


MIRROR = np.diag([1.0, -1.0, 1.0])


def true_links(root, seed, pairs, alike):
    """Every link changed. With `alike`, of a pair (right, left) the left one is the image of the right one, y to −y."""
    rng = np.random.default_rng(seed)
    nominal = inertials(root)
    of_right = {left: right for right, left in pairs} if alike else {}
    drawn = {}
    for name in nominal:
        if name not in of_right:
            drawn[name] = draw(rng)
    for left, right in of_right.items():
        m, c, t = nominal[right]
        ml, cl, tl = nominal[left]
        assert np.isclose(m, ml) and np.allclose(MIRROR @ c, cl) and np.allclose(MIRROR @ t @ MIRROR, tl), left
        scale, shift, stretch = drawn[right]
        drawn[left] = (scale, MIRROR @ shift, MIRROR @ stretch @ MIRROR)
    # Seven digits, so that a file holds them exactly.
    rounded = lambda values: np.array([float(f"{v:.7g}") for v in np.ravel(values)]).reshape(np.shape(values))
    return {name: tuple(rounded(v) for v in changed(nominal[name], *drawn[name])) for name in nominal}


def put(root, links):
    """Writes inertials into the URDF."""
    for link in root.findall("link"):
        own = link.find("inertial")
        if own is None:
            continue
        mass, centre, tensor = links[link.get("name")]
        own.find("mass").set("value", repr(float(mass)))
        origin = own.find("origin")
        if origin is None:
            origin = ElementTree.SubElement(own, "origin")
        origin.set("xyz", " ".join(repr(float(v)) for v in centre))
        for key, value in zip(["ixx", "iyy", "izz", "ixy", "ixz", "iyz"], elements(tensor)):
            own.find("inertia").set(key, repr(float(value)))


def elements(tensor):
    """Ixx Iyy Izz Ixy Ixz Iyz."""
    return [tensor[0, 0], tensor[1, 1], tensor[2, 2], tensor[0, 1], tensor[0, 2], tensor[1, 2]]


def rotation(rpy):
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return (
        np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
        @ np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
        @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    )


def bodies(root, links):
    """What moves as one, by the name of its first link: its links on fixed joints with it, about its centre of mass."""
    parent = {j.find("child").get("link"): j for j in root.findall("joint")}

    def holder(name):
        place, position = np.eye(3), np.zeros(3)
        while name in parent and parent[name].get("type") == "fixed":
            joint = parent[name]
            origin = joint.find("origin")
            turn = rotation(numbers(origin.get("rpy", "0 0 0"))) if origin is not None else np.eye(3)
            at = numbers(origin.get("xyz", "0 0 0")) if origin is not None else np.zeros(3)
            place, position = turn @ place, turn @ position + at
            name = joint.find("parent").get("link")
        return name, place, position

    sums = {}
    for name, (mass, centre, tensor) in links.items():
        own, turn, at = holder(name)
        c = turn @ centre + at
        about = turn @ tensor @ turn.T + mass * (c @ c * np.eye(3) - np.outer(c, c))
        m, mc, t, names = sums.get(own, (0.0, np.zeros(3), np.zeros((3, 3)), []))
        sums[own] = (m + mass, mc + mass * c, t + about, names + [name])
    found = {}
    for name, (m, mc, t, names) in sums.items():
        c = mc / m
        found[name] = (m, c, t - m * (c @ c * np.eye(3) - np.outer(c, c)), names)
    return found
