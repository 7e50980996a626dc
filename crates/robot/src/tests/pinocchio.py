"""Writes pinocchio.json, beside this file: poses and Jacobians that pinocchio computes.

    python3 -m venv venv && venv/bin/pip install pin==4.1.0
    SUBLEVEL_DATA=... venv/bin/python crates/robot/src/tests/pinocchio.py

All numbers are drawn from fixed seeds, so it writes the same robots and values each time; another
machine or version of pin may round poses and Jacobians differently. The robots are two of
robots.rs, of which only the kinematics is repeated here, the Panda of the test data, and trees with
joints of all kinds, whose descriptions are in the file under "trees".

"values" are those of this crate, and "jacobian" has the derivatives by them: metres, radians, world
frame. A joint of several values has that many entries, one after the other. Differences:

- continuous: the value is the angle; pinocchio holds cosine and sine.
- planar: x, y, angle; pinocchio holds x, y, cosine, sine, and its velocities are in the frame of
  the child. It ignores <axis>: it moves in x and y of the frame of the joint and turns about z.
  `move_across` turns that frame, so that z is the axis.
- floating: x, y, z, and the unit quaternion x, y, z, w, as in pinocchio. The Jacobian is by these 7
  numbers; that of pinocchio is by linear and angular velocity in the frame of the child.
- <mimic>: pinocchio reads it with mimic=True only. What follows a continuous joint has to be
  continuous, and what follows another joint must not be. The joint that is followed has to come
  first where joints are visited depth first, those of one link by name.
- <limit>: the reader of pinocchio requires effort and velocity, too.
"""

import json
import os
import pathlib
import random
import sys
import xml.etree.ElementTree as xml

HERE = pathlib.Path(__file__).resolve().parent
# This file has the name of the package, and Python would look here first.
sys.path = [path for path in sys.path if pathlib.Path(path).resolve() != HERE]

import numpy as np  # noqa: E402
import pinocchio as pin  # noqa: E402

# Axes of the planar joints of the trees, one a tree. With the first, pinocchio needs no change.
PLANES = ["0 0 1", "0.2 -0.1 0.9", "0.6 0.5 -0.3", "0 0 -2"]
# Largest value of a joint without limits: radians, metres.
TURN, SHIFT = 3.0, 1.0


def joint(name, kind, parent, child, axis="1 0 0", limits=None, origin="0 0 0", rpy="0 0 0", mimic=None):
    """One joint as text; `limits` are lower and upper, `mimic` the joint, multiplier and offset."""
    text = f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
    text += f'<origin xyz="{origin}" rpy="{rpy}"/><axis xyz="{axis}"/>'
    if limits:
        text += f'<limit lower="{limits[0]}" upper="{limits[1]}" effort="1" velocity="1"/>'
    if mimic:
        text += f'<mimic joint="{mimic[0]}" multiplier="{mimic[1]}" offset="{mimic[2]}"/>'
    return text + "</joint>"


def robot(name, links, joints):
    """A description as text, of names of links and texts of joints."""
    return f'<robot name="{name}">' + "".join([f'<link name="{link}"/>' for link in links] + joints) + "</robot>"


def six_axis():
    """`six_axis_arm` of robots.rs, with limits that are a little closer."""
    links = ["base", "tool"] + [f"link_{index}" for index in range(7)]
    joints = [joint("mount", "fixed", "base", "link_0"), joint("flange", "fixed", "link_6", "tool", origin="0 0.1 0")]
    for index, axis in enumerate(["0 0 1", "0 1 0", "0 1 0", "0 1 0", "0 0 1", "0 1 0"]):
        ends = f"link_{index}", f"link_{index + 1}"
        joints.append(joint(f"joint_{index + 1}", "revolute", *ends, axis, (-6, 6), "0 0.1 0.2", "0 0.5 0"))
    return robot("six_axis", links, joints)


def mobile():
    """`mobile_manipulator` of robots.rs."""
    joints = [
        joint("left_wheel_joint", "continuous", "base", "left_wheel", "0 1 0"),
        joint("right_wheel_joint", "continuous", "base", "right_wheel", "0 1 0"),
        joint("lift", "prismatic", "base", "torso", "0 0 1", (0, 0.4)),
        joint("pan", "revolute", "torso", "shoulder", "0 0 1", (-1.6, 1.6)),
        joint("roll", "continuous", "shoulder", "upper_arm", "1 0 0"),
        joint("flex", "revolute", "upper_arm", "forearm", "0 1 0", (-2, 2)),
        joint("laser_joint", "fixed", "base", "laser", origin="0.2 0 0.3"),
        joint("gripper_joint", "fixed", "forearm", "gripper", origin="0.2 0 0"),
        joint("left_finger_joint", "prismatic", "gripper", "left_finger", "0 1 0", (0, 0.05)),
        joint("right_finger_joint", "prismatic", "gripper", "right_finger", "0 1 0", (-0.05, 0),
              mimic=("left_finger_joint", -1, 0)),
    ]
    links = ["base", "left_wheel", "right_wheel", "torso", "shoulder", "upper_arm", "forearm"]
    return robot("mobile", links + ["left_finger", "right_finger", "laser", "gripper"], joints)


def tree(name, plane, draw):
    """A tree of 9 links with joints of all kinds, two of which follow others.

    Joints are in no order. `plane` is the axis of the planar joint. Returns the text and the links
    on which no other one hangs.
    """
    kinds = ["revolute", "prismatic", "prismatic", "continuous", "continuous", "fixed", "planar", "floating"]
    while kinds[-1] in ("planar", "floating"):
        draw.shuffle(kinds)
    bounded = [child for child, kind in enumerate(kinds, 1) if kind in ("revolute", "prismatic")]
    unbounded = [child for child, kind in enumerate(kinds, 1) if kind == "continuous"]
    followed = {bounded[-1]: bounded[0], unbounded[-1]: unbounded[0]}

    def numbers(size):
        return " ".join(str(round(draw.uniform(-size, size), 3)) for _ in range(3))

    # Links are numbered depth first; `path` leads from the root to the last one. The link of a
    # planar or floating joint always has a child, whose position shows how the joint turns.
    joints, leaves, path = [], set(), [0]
    for child, kind in enumerate(kinds, 1):
        moved_freely = child > 1 and kinds[child - 2] in ("planar", "floating")
        parent = path[-1] if moved_freely else draw.choice(path[-2:])
        path = path[: path.index(parent) + 1] + [child]
        leaves = leaves - {parent} | {child}
        axis, limits, mimic = numbers(1), None, None
        if kind == "planar":
            axis = plane
        if child in bounded:
            limits = -2, 2
        if child in followed:
            mimic = f"joint_{followed[child]}", round(draw.uniform(-2, 2), 3), round(draw.uniform(-1, 1), 3)
        ends = f"link_{parent}", f"link_{child}"
        joints.append(joint(f"joint_{child}", kind, *ends, axis, limits, numbers(0.5), numbers(3), mimic))
    draw.shuffle(joints)
    text = robot(name, [f"link_{index}" for index in range(len(kinds) + 1)], joints)
    return text, [f"link_{leaf}" for leaf in sorted(leaves)]


def read(urdf):
    """The model of a description, with planar joints across their axes."""
    model = pin.buildModelFromXML(urdf, mimic=True)
    for element in xml.fromstring(urdf).iter("joint"):
        if element.get("type") == "planar":
            axis = np.array(element.find("axis").get("xyz").split(), float)
            move_across(model, model.getJointId(element.get("name")), axis / np.linalg.norm(axis))
    return model


def move_across(model, planar, axis):
    """Turns the frame of a planar joint from z to the axis, and what hangs on it back.

    x and y come to the two directions that this crate takes (`TreeJoint::new`): for the axis z they
    are x and y themselves.
    """
    helper = np.array([1.0, 0.0, 0.0] if abs(axis[2]) > 0.9 else [0.0, 0.0, 1.0])
    one = helper - axis * axis.dot(helper)
    one /= np.linalg.norm(one)
    turn = pin.SE3(np.column_stack([one, np.cross(axis, one), axis]), np.zeros(3))
    model.jointPlacements[planar] = model.jointPlacements[planar] * turn
    for child in model.children[planar]:
        model.jointPlacements[child] = turn.inverse() * model.jointPlacements[child]
    for frame in model.frames:
        if frame.parentJoint == planar:
            frame.placement = turn.inverse() * frame.placement


def variables(model):
    """Names and models of the joints that follow no other one."""
    joints = list(zip(model.names, model.joints))[1:]
    return [(name, own) for name, own in joints if own.shortname() != "JointModelMimic"]


def draw_values(model, own, draw):
    """Values of one joint as this crate holds them, and as pinocchio does."""

    def within(lower, upper):
        return round(draw.uniform(lower, upper), 6)

    if own.nq == 1:
        value = within(model.lowerPositionLimit[own.idx_q], model.upperPositionLimit[own.idx_q])
        return [value], [value]
    if own.shortname() == "JointModelFreeFlyer":
        shift = [within(-SHIFT, SHIFT) for _ in range(3)]
        quaternion = np.array([draw.gauss(0.0, 1.0) for _ in range(4)])
        values = shift + list(quaternion / np.linalg.norm(quaternion))
        return values, values
    shift = [within(-SHIFT, SHIFT) for _ in range(2)] if own.shortname() == "JointModelPlanar" else []
    angle = within(-TURN, TURN)
    return shift + [angle], shift + [np.cos(angle), np.sin(angle)]


def rates(own, q):
    """Velocities of a joint as pinocchio takes them, per unit of each value of this crate."""
    rate = np.eye(own.nv)
    if own.shortname() == "JointModelPlanar":
        cosine, sine = q[2:]
        rate[:2, :2] = [[cosine, sine], [-sine, cosine]]
    if own.shortname() == "JointModelFreeFlyer":
        # The angular velocity is 2 Im(q^-1 q') in the frame of the child.
        imaginary, real = q[3:6], q[6]
        turning = 2.0 * np.column_stack([real * np.eye(3) - pin.skew(imaginary), -imaginary])
        rotation = pin.Quaternion(q[3:]).toRotationMatrix()
        rate = np.block([[rotation.T, np.zeros((3, 4))], [np.zeros((3, 3)), turning]])
    return rate


def cases(name, urdf, links, draw, configurations=4):
    """Poses and Jacobians of links at values drawn within the limits."""
    model = read(urdf)
    data = model.createData()
    for _ in range(configurations):
        q = pin.neutral(model)
        values = []
        for joint_name, own in variables(model):
            held, q[own.idx_q : own.idx_q + own.nq] = draw_values(model, own, draw)
            values += [[joint_name, float(value)] for value in held]
        pin.framesForwardKinematics(model, data, q)
        for link in links:
            frame = model.getFrameId(link, pin.BODY)
            pose = data.oMf[frame]
            jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
            jacobian = jacobian.reshape(6, model.nv)
            rows = []
            for joint_name, own in variables(model):
                columns = jacobian[:, own.idx_v : own.idx_v + own.nv]
                columns = columns @ rates(own, q[own.idx_q : own.idx_q + own.nq])
                rows += [[joint_name, *column] for column in columns.T.tolist()]
            yield {
                "robot": name,
                "link": link,
                "values": values,
                "rotation": pose.rotation.flatten().tolist(),
                "translation": pose.translation.tolist(),
                "jacobian": rows,
            }


def main():
    panda = (pathlib.Path(os.environ["SUBLEVEL_DATA"]) / "panda/panda.urdf").read_text()
    draw = random.Random(7)
    found = list(cases("six_axis", six_axis(), ["tool", "link_3"], draw))
    found += cases("mobile", mobile(), ["right_finger", "left_finger", "left_wheel"], draw)
    found += cases("panda", panda, ["panda_hand", "panda_rightfinger", "panda_link4"], draw)
    trees = {}
    for number, plane in enumerate(PLANES):
        draw = random.Random(number)
        name = f"tree_{number}"
        trees[name], leaves = tree(name, plane, draw)
        found += cases(name, trees[name], leaves, draw, configurations=2)
    lines = ",\n".join(json.dumps(case) for case in found)
    source = json.dumps(f"computed by pinocchio {pin.__version__}")
    texts = json.dumps(trees, indent=0)
    text = f'{{"source": {source}, "trees": {texts}, "cases": [\n{lines}\n]}}\n'
    (HERE / "pinocchio.json").write_text(text)
    print(f"{len(found)} cases")


if __name__ == "__main__":
    main()
