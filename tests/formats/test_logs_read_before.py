"""Logs that need no rule about other things: a rule for these does not hide a sensor, turn a sign or take another's clock."""

from __future__ import annotations

import numpy as np
import pytest

from tests.formats.corpus.truth import DEG
from tests.formats.test_field_logs import MOVED, G, is_read, rows
from tests.runs import some
from truenorth.formats import UnsureError, read_imu
from truenorth.formats.names import clock_of

TIME, RATES, FORCES = MOVED.time, MOVED.gyro, MOVED.accel
NOISE = np.random.default_rng(3).standard_normal((len(TIME), 4))
STILL_RATES, STILL_FORCES = 2e-3 * NOISE[:, :3], np.array([9.8, 0.1, -0.2]) + 0.02 * NOISE[:, 1:]


def log(tmp_path, header, *parts, above="", name="log.csv"):
    """A table on disk; no header where it is empty."""
    path = tmp_path / name
    path.write_text(above + (header + "\n" if header else "") + rows(*parts))
    return path


# ---------------------------------------------------------------------------------------------------- constant columns


@pytest.mark.parametrize("header", ["t,u1,u2,u3,s1,s2,s3,k", "", "t,u1,u2,u3,s1,s2,s3"])
def test_a_constant_column_stays_in_its_three(tmp_path, header):
    gyro, extra = STILL_RATES * [1, 1, 0], [0.05 * NOISE[:, 3]] if header.endswith("k") else []
    path = log(tmp_path, header, TIME, gyro, STILL_FORCES, *extra)
    record = read_imu(path, units={"gyro": "rad/s"})
    np.testing.assert_allclose(record.gyro, gyro, atol=1e-8)
    np.testing.assert_allclose(record.accel, STILL_FORCES, atol=1e-7)


def test_a_log_without_noise_and_one_with_two_constant_forces(tmp_path):
    level = np.column_stack([0 * TIME, 0 * TIME, 9.8 + np.round(0.02 * NOISE[:, 0], 2)])
    for forces in (level, np.tile([0.0, 0.0, 9.8], (len(TIME), 1))):
        path = log(tmp_path, "", TIME, STILL_RATES, forces)
        np.testing.assert_allclose(read_imu(path, units={"gyro": "rad/s"}).accel, forces, atol=1e-7)


# ------------------------------------------------------------------------------------------------------ signs and sizes


@pytest.mark.parametrize(
    ("pattern", "gyro", "size"),
    [
        ("accelerometerAcceleration{}", "gyro{}", 1),
        ("Accelerometer Acceleration {} (m/s^2)", "Gyro {} (rad/s)", 1),
        ("accelerometerAcceleration{}(G)", "gyro{}", G),
        ("Accelerometer Acceleration {} (m/s^2)", "gyroRotation{}(rad/s)", 1),
    ],
)
def test_accelerations_of_other_programs_than_an_iphones_keep_their_signs(tmp_path, pattern, gyro, size):
    header = ",".join(["time", *(pattern.format(axis) for axis in "XYZ"), *(gyro.format(axis) for axis in "XYZ")])
    is_read(log(tmp_path, header, TIME, FORCES / size, RATES))


def test_an_iphones_accelerations_without_a_unit_have_their_signs_turned(tmp_path):
    header = "accelerometerTimestamp_sinceReboot," + ",".join(f"accelerometerAcceleration{axis}" for axis in "XYZ")
    header += "," + ",".join(f"gyroRotation{axis}" for axis in "XYZ")
    is_read(log(tmp_path, header, TIME, -FORCES / G, RATES))


@pytest.mark.parametrize("line", ['"acc_1G","2048"\n', "ascale,0.00048828125\n"])
def test_a_heading_and_the_caller_win_over_a_line_above_the_table(tmp_path, line):
    above = "gscale,0.00122173047\n" + line
    header = "t,gx [deg/s],gy [deg/s],gz [deg/s],ax [m/s^2],ay [m/s^2],az [m/s^2]"
    is_read(log(tmp_path, header, TIME, RATES / DEG, FORCES, above=above))
    path = log(tmp_path, "t,gx,gy,gz,ax,ay,az", TIME, RATES / DEG, FORCES, above=above)
    is_read(path, units={"gyro": "deg/s", "accel": "m/s^2"})
    is_read(path, units={"gyro": "deg/s"})


# -------------------------------------------------------------------------------------------------------------- clocks


@pytest.mark.parametrize(
    "name", "T1 t1 t2 tb TB b_t time2 clock1 left_t T1_(degC) T_(degC)".replace("_(", "~(").split()
)
def test_what_rises_next_to_the_clock_is_no_clock(name):
    assert clock_of(name.replace("~", " ")) == (False, None)


@pytest.mark.parametrize("name", ["imu_t", "imu0_time", "raw_time", "Shimmer_67AF_Timestamp_Unix_CAL", "device_time"])
def test_a_word_before_a_clock_leaves_it_one(name):
    assert clock_of(name) == (True, None)


def test_a_clock_without_a_word_before_it_comes_first(tmp_path):
    """The temperature that rises, and the time of another computer."""
    for header, other in (("T1 (degC)", 20.0 + 0.02 * TIME), ("raw_time", 2.0 * TIME)):
        path = log(tmp_path, f"{header},timestamp,gx,gy,gz,ax,ay,az", other, TIME, RATES, FORCES)
        is_read(path)


# -------------------------------------------------------------------------------------------------------------- angles


@pytest.mark.parametrize("names", some(["u1,u2,u3"], ["gx,gy,gz", "rotX,rotY,rotZ"]))
def test_the_rates_of_a_car_are_no_angles(tmp_path, names):
    """A car that turns leans a little and is pushed aside: as if the changes of its rate were the turns of gravity."""
    random, time, asked = np.random.default_rng(3), np.arange(3000) / 100, []
    for _ in range(8):
        times = random.uniform(0, 30, 3), random.uniform(1, 4, 3)
        turns = np.exp(-0.5 * ((time[:, None] - times[0]) / times[1]) ** 2)
        yaw = turns @ (random.uniform(0.1, 0.4, 3) * random.choice([-1, 1], 3))
        push = turns[:, ::-1] @ random.uniform(-1.5, 1.5, 3)
        rates = np.column_stack([np.gradient(-0.1 * yaw, time), np.gradient(0.01 * push, time), yaw])
        rates += 2e-3 * random.standard_normal((3000, 3))
        forces = np.column_stack([push, 10 * yaw, 0 * time + 9.8]) + 0.3 * random.standard_normal((3000, 3))
        path = log(tmp_path, f"time,{names},ax,ay,az", time, rates, forces)
        try:
            np.testing.assert_allclose(read_imu(path).gyro, rates, atol=1e-6)
        except UnsureError as error:
            asked.append(str(error))
    assert not any("angles" in question for question in asked)


def test_angles_are_asked_about_and_the_answer_counts(tmp_path):
    angles = np.cumsum(RATES, axis=0) * 0.01 / DEG
    path = log(tmp_path, "time,rotX,rotY,rotZ,accX,accY,accZ", TIME, angles, FORCES)
    with pytest.raises(UnsureError, match="turn gravity by what they change by") as said:
        read_imu(path)
    assert len(said.value.options) == 3
    np.testing.assert_allclose(read_imu(path, units={"gyro": "deg/s"}).gyro, angles * DEG, atol=1e-6)
    is_read(log(tmp_path, "time,gx,gy,gz,ax,ay,az", TIME, RATES, FORCES))


# ------------------------------------------------------------------------------------------------- names of other things


@pytest.mark.parametrize(
    ("names", "size", "force"),
    [
        ("p,q,r,nx,ny,nz", 1, G),
        ("P (rad/s),Q (rad/s),R (rad/s),Nx (g),Ny (g),Nz (g)", 1, G),
        ("p_dps,q_dps,r_dps,nx_g,ny_g,nz_g", DEG, G),
        ("roll_vel,pitch_vel,yaw_vel,acc_x,acc_y,acc_z", 1, 1),
        ("roll_speed,pitch_speed,yaw_speed,x_acc,y_acc,z_acc", 1, 1),
        ("roll_w,pitch_w,yaw_w,ax,ay,az", 1, 1),
        ("roll (deg/s),pitch (deg/s),yaw (deg/s),ax,ay,az", DEG, 1),
        ("vel_ang_x,vel_ang_y,vel_ang_z,acc_x,acc_y,acc_z", 1, 1),
        ("vel_x,vel_y,vel_z,acel_x,acel_y,acel_z", 1, 1),
        ("w_fwd,w_left,w_up,f_fwd,f_left,f_up", 1, 1),
        ("hx,hy,hz,bx,by,bz", 1, 1),
        ("frame_x,frame_y,frame_z,frame2_x,frame2_y,frame2_z", 1, 1),
        ("dax,day,daz,u_x,u_y,u_z", 1, 1),
    ],
)
def test_names_of_gyros_that_have_words_of_other_things(tmp_path, names, size, force):
    is_read(log(tmp_path, f"time,{names}", TIME, RATES / size, FORCES / force))


@pytest.mark.parametrize("names", ["vel_x,vel_y,vel_z", "rotx [deg],roty [deg],rotz [deg]"])
def test_columns_that_say_no_rates_are_asked_about(tmp_path, names):
    path = log(tmp_path, f"time,{names},ax,ay,az", TIME, RATES / DEG, FORCES)
    with pytest.raises(UnsureError, match="by their names are no rates") as said:
        read_imu(path)
    is_read(path, columns=said.value.options[0]["columns"], units={"gyro": "deg/s"})


@pytest.mark.parametrize(("count", "rate"), [(1e-4, 10.0), (1e-4, 20.0), (1e-4, 400.0), (1e-6, 30.0)])
def test_the_fine_time_of_an_xsens_at_other_rates(tmp_path, count, rate):
    """A count of 1 us would be 1000 rows a second and more where an MTi writes 10."""
    time = np.arange(len(TIME)) / rate
    header = "PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z"
    stamps = [f"{round(t / count)}" for t in time]
    path = log(tmp_path, header, np.arange(len(time)), stamps, STILL_FORCES, STILL_RATES)
    np.testing.assert_allclose(read_imu(path, units={"gyro": "rad/s"}).time, time, atol=1e-4)


def test_a_sentence_of_a_receiver_above_a_table(tmp_path):
    sentence = "$GPGGA,100000,5230.0,N,01320.0,E,1,8,1,30,M,0,M,,*47\n"
    path = log(tmp_path, "time,ax,ay,az,gx,gy,gz", TIME, FORCES, RATES, above=sentence)
    is_read(path)


def test_accelerations_in_ug_are_read(tmp_path):
    forces = STILL_FORCES * (G / np.linalg.norm(np.median(STILL_FORCES, axis=0)))
    path = log(tmp_path, "time,acc_x,acc_y,acc_z,gyro_x,gyro_y,gyro_z", TIME, forces / G * 1e6, STILL_RATES)
    np.testing.assert_allclose(read_imu(path, units={"gyro": "rad/s"}).accel, forces, atol=1e-5)


def test_accelerations_without_gravity_next_to_a_phones_rates_are_asked_about(tmp_path):
    stems = {"motionRotationRate": "rad/s", "motionUserAcceleration": "G", "motionGravity": "G"}
    names = [f"{stem}{axis}({unit})" for stem, unit in stems.items() for axis in "XYZ"]
    path = log(tmp_path, ",".join(["t", *names]), TIME, RATES, 0.02 * NOISE[:, :3], FORCES / G)
    with pytest.raises(UnsureError, match="2 sets of three columns may be the gyros"):
        read_imu(path)


def test_gravity_alone_is_not_taken_for_specific_force(tmp_path):
    path = log(tmp_path, "t,u1,u2,u3,gravityX (g),gravityY (g),gravityZ (g)", TIME, RATES, FORCES / G)
    with pytest.raises(UnsureError, match="show nothing else by their names"):
        read_imu(path)
