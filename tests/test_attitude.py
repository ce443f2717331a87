"""Attitude: laws of rotations, the conventions as DESIGN states them, and SciPy as the oracle."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from truenorth.core import attitude
from truenorth.core.compiled import compiled
from truenorth.core.errors import UsageError

angles = st.floats(-10.0, 10.0)
vectors = st.tuples(*[st.floats(-2.0, 2.0)] * 3).map(np.array)
unit_quaternions = (
    st.tuples(*[st.floats(-1.0, 1.0)] * 4)
    .map(np.array)
    .filter(lambda q: np.linalg.norm(q) > 0.1)
    .map(lambda q: q / np.linalg.norm(q))
)
ROUNDING = 1e-14


@given(angles, angles, angles)
def test_euler_angles_are_the_stated_product(heading, pitch, roll):
    def R(axis, angle):
        return Rotation.from_euler(axis, angle).as_matrix()

    expected = R("z", -heading) @ R("x", pitch) @ R("y", roll)
    np.testing.assert_allclose(attitude.dcm_from_euler(heading, pitch, roll), expected, atol=ROUNDING)


def test_signs_of_the_angles():
    """Heading 90 deg points y east; pitch lifts y; roll lowers x, the right side."""
    east = attitude.dcm_from_euler(np.pi / 2, 0, 0) @ [0, 1, 0]
    np.testing.assert_allclose(east, [1, 0, 0], atol=ROUNDING)
    nose = attitude.dcm_from_euler(0, 0.1, 0) @ [0, 1, 0]
    np.testing.assert_allclose(nose, [0, np.cos(0.1), np.sin(0.1)], atol=ROUNDING)
    right = attitude.dcm_from_euler(0, 0, 0.1) @ [1, 0, 0]
    np.testing.assert_allclose(right, [np.cos(0.1), 0, -np.sin(0.1)], atol=ROUNDING)


@given(st.floats(0, 6.283), st.floats(-1.57, 1.57), st.floats(-3.14, 3.14))
def test_euler_angles_come_back(heading, pitch, roll):
    h, p, r = attitude.euler_from_dcm(attitude.dcm_from_euler(heading, pitch, roll))
    near = 1e-15 / np.cos(pitch)  # heading and roll lose meaning towards the vertical
    assert abs((h - heading + np.pi) % (2 * np.pi) - np.pi) < 4 * near
    assert p == pytest.approx(pitch, abs=1e-15 + 4 * near * np.cos(pitch))
    assert r == pytest.approx(roll, abs=4 * near)


@given(unit_quaternions)
def test_heading_is_below_a_full_turn(q):
    heading, _, _ = attitude.euler_from_dcm(attitude.dcm_from_quaternion(q))
    assert 0.0 <= heading < 2 * np.pi


def test_heading_a_hair_west_of_north_is_not_a_full_turn():
    assert attitude.euler_from_dcm(attitude.dcm_from_euler(-1e-17, 0, 0))[0] == 0.0


@pytest.mark.parametrize("nose", [1, -1])
@given(heading=st.floats(0, 6.28), roll=st.floats(-3, 3))
def test_at_the_vertical_the_observable_combination_is_given(nose, heading, roll):
    C = attitude.dcm_from_euler(heading, nose * np.pi / 2, roll)
    h, p, r = attitude.euler_from_dcm(C)
    assert r == 0.0
    assert p == pytest.approx(nose * np.pi / 2, abs=1e-8)
    assert abs((h - (heading - nose * roll) + np.pi) % (2 * np.pi) - np.pi) < 1e-14
    np.testing.assert_allclose(attitude.dcm_from_euler(h, p, r), C, atol=1e-14)


@given(vectors, vectors)
def test_skew_is_the_cross_product(a, b):
    np.testing.assert_allclose(attitude.skew(a) @ b, np.cross(a, b), atol=ROUNDING)


@given(vectors, st.sampled_from([0.0, 1e-9, 1e-5, 1e-2, 1.0]))
def test_rotation_vectors_as_scipy(v, scale):
    C = attitude.dcm_from_rotation_vector(scale * v)
    np.testing.assert_allclose(C, Rotation.from_rotvec(scale * v).as_matrix(), atol=ROUNDING)
    if np.linalg.norm(scale * v) < 3.1:
        np.testing.assert_allclose(attitude.rotation_vector_from_dcm(C), scale * v, atol=1e-14, rtol=1e-13)


@given(vectors, st.sampled_from([0.0, 1e-13, 1e-5, 1.0, np.pi]))
def test_one_rotation_vector_is_to_the_bit_that_of_a_stack(v, scale):
    C = attitude.dcm_from_rotation_vector(scale * v)
    assert np.array_equal(attitude.rotation_vector_from_dcm(C), attitude.rotation_vector_from_dcm(C[None])[0])


@given(unit_quaternions)
def test_quaternions_as_scipy(q):
    C = attitude.dcm_from_quaternion(q)
    np.testing.assert_allclose(C, Rotation.from_quat(q, scalar_first=True).as_matrix(), atol=ROUNDING)
    back = attitude.quaternion_from_dcm(C)
    assert back[0] >= 0
    np.testing.assert_allclose(back * np.sign(back @ q), q, atol=ROUNDING)


@pytest.mark.parametrize("axis", np.eye(3))
def test_half_turns_have_a_quaternion(axis):
    C = 2 * np.outer(axis, axis) - np.eye(3)
    np.testing.assert_allclose(np.abs(attitude.quaternion_from_dcm(C)), [0, *axis], atol=1e-15)
    assert np.linalg.norm(attitude.rotation_vector_from_dcm(C)) == pytest.approx(np.pi, abs=1e-15)


def test_leading_axes_are_runs():
    rng = np.random.default_rng(1)
    v = rng.normal(size=(2, 5, 3))
    C = attitude.dcm_from_rotation_vector(v)
    for i, j in itertools.product(range(2), range(5)):
        one = attitude.dcm_from_rotation_vector(v[i, j])
        np.testing.assert_allclose(C[i, j], one, atol=1e-15)
        np.testing.assert_allclose(attitude.quaternion_from_dcm(C)[i, j], attitude.quaternion_from_dcm(one), atol=1e-15)
        np.testing.assert_allclose(
            np.array(attitude.euler_from_dcm(C))[:, i, j], attitude.euler_from_dcm(one), atol=1e-15
        )


def test_scipy_has_the_same_rotation():
    C = attitude.dcm_from_euler([0.3, 2.0], 0.1, -0.2)
    np.testing.assert_allclose(attitude.to_rotation(C).as_matrix(), C, atol=ROUNDING)


def test_frd_and_flu():
    """A vector forward, given in FRD as (1, 0, 0), is (0, 1, 0) in RFU; down is up's opposite."""
    np.testing.assert_array_equal(attitude.body_axes("FRD") @ [1, 2, 3], [2, 1, -3])
    np.testing.assert_array_equal(attitude.body_axes("FLU") @ [1, 2, 3], [-2, 1, 3])
    np.testing.assert_array_equal(attitude.body_axes("rfu"), np.eye(3))


def test_the_24_right_handed_axes_and_their_mirror_images_are_taken():
    taken = []
    for letters in itertools.product("RLFBUD", repeat=3):
        try:
            C = attitude.body_axes("".join(letters))
        except UsageError:
            continue
        np.testing.assert_array_equal(C @ C.T, np.eye(3))
        taken.append(round(np.linalg.det(C)))
    assert sorted(taken) == [-1] * 24 + [1] * 24


@pytest.mark.parametrize(
    ("axes", "words"),
    [
        ("FRB", "one axis"),
        ("FFU", "one axis"),
        ("NED", "three letters"),
        ("FR", "three letters"),
        ("", "three letters"),
    ],
)
def test_wrong_axes_say_what_is_wrong(axes, words):
    with pytest.raises(UsageError, match=words):
        attitude.body_axes(axes)


@compiled
def _through_the_kernels(p, q, v):
    """Each kernel once, from compiled code, on tuples."""
    r = (v[0], v[1], v[2])
    a, b = (p[0], p[1], p[2], p[3]), (q[0], q[1], q[2], q[3])
    longer = (b[0] * (1 + 1e-9), b[1] * (1 + 1e-9), b[2] * (1 + 1e-9), b[3] * (1 + 1e-9))
    return (
        attitude.quaternion_product(a, b),
        attitude.quaternion_from_rotation_vector(r),
        attitude.rotate(a, r),
        attitude.normalised(longer),
        attitude.cross(r, (a[1], a[2], a[3])),
    )


@settings(deadline=None)  # the first call compiles
@given(unit_quaternions, unit_quaternions, vectors, st.sampled_from([0.0, 1e-6, 3e-3, 6e-3, 1e-2, 1.0]))
def test_kernels_as_scipy(p, q, v, scale):
    """Rotation vectors on both sides of the series' limit of .01 rad."""
    v = scale * v
    product, of_vector, turned, unit, crossed = map(np.array, _through_the_kernels(p, q, v))
    P, Q = (Rotation.from_quat(x, scalar_first=True) for x in (p, q))
    expected = (P * Q).as_quat(scalar_first=True)
    np.testing.assert_allclose(product * np.sign(product @ expected), expected, atol=ROUNDING)
    expected = Rotation.from_rotvec(v).as_quat(scalar_first=True)
    np.testing.assert_allclose(of_vector * np.sign(of_vector @ expected), expected, atol=1e-15, rtol=1e-15)
    np.testing.assert_allclose(turned, P.apply(v), atol=ROUNDING)
    np.testing.assert_allclose(unit, q, atol=1e-15)
    np.testing.assert_allclose(crossed, np.cross(v, p[1:]), atol=ROUNDING)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_the_length_of_a_vector_is_numpys_to_the_bit(scale):
    for v in scale * np.random.default_rng(3).standard_normal((200, 3)):
        assert attitude.length_of(v) == np.linalg.norm(v)
