"""IMU recordings as CSV, as data sets and phone apps write them; what cannot be read is refused with what was found."""

import numpy as np
import pytest

from gravcomp.config import ConfigError
from gravcomp.recordings.imu import RecordingError, read_mapping, read_recording
from gravcomp.standard_gravity import STANDARD_GRAVITY

N = 6
GYRO = np.array([[0.1 * k, -0.2 * k, 0.3 * k] for k in range(N)])  # rad/s
ACCEL = np.array([[0.01 * k, 0.02 * k, STANDARD_GRAVITY] for k in range(N)])
NS = [1403636579758555392 + 5_000_000 * k for k in range(N)]


def lines(header, rows, separator=",", comma=False):
    text = [header] if isinstance(header, str) else list(header)
    for row in rows:
        fields = [str(field) for field in row]
        text.append(separator.join(field.replace(".", ",") if comma else field for field in fields))
    return "\n".join(text) + "\n"


def rows(*parts):
    return [[x for part in of_row for x in np.atleast_1d(part).tolist()] for of_row in zip(*parts)]


EUROC = "#timestamp [ns]," + ",".join(
    f"{q}_RS_S_{axis} [{unit}]" for q, unit in (("w", "rad s^-1"), ("a", "m s^-2")) for axis in "xyz"
)
EUROC_TRUTH = "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []"
REPO = ("Time (s);Vicon Orientation;;;;IMU Acceleration;;;IMU Gyroscope;;;IMU Magnetometer;;;", ";W;X;Y;Z;X;Y;Z;X;Y;Z;X;Y;Z;")
XIMU = "Packet number,Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),Accelerometer X (g),Accelerometer Y (g),Accelerometer Z (g),Magnetometer X (G),Magnetometer Y (G),Magnetometer Z (G)"  # noqa: E501
XIMU3 = XIMU.replace("Packet number", "Timestamp (us)")
LOGGER = "time,seconds_elapsed,z,y,x"
SECONDS = [0.005 * k for k in range(N)]


def check(recording, rate=200.0):
    assert recording.gyro == pytest.approx(GYRO, abs=1e-9) and recording.accel == pytest.approx(ACCEL, abs=1e-9)
    assert recording.rate == pytest.approx(rate)


def test_the_tree_of_euroc_with_its_truth(tmp_path):
    imu, truth = tmp_path / "mav0" / "imu0", tmp_path / "mav0" / "state_groundtruth_estimate0"
    imu.mkdir(parents=True)
    truth.mkdir()
    (imu / "data.csv").write_text(lines(EUROC, rows(NS, GYRO, ACCEL)), encoding="utf-8")
    turned = np.tile([0.0, 0.0, 0.0, 0.6, 0.8, 0.0, 0.0], (N, 1))
    (truth / "data.csv").write_text(lines(EUROC_TRUTH, rows(NS[2:], turned[2:])), encoding="utf-8")
    for path in (tmp_path, imu / "data.csv"):
        recording = read_recording(path)
        check(recording)
        assert recording.stamp_ns.tolist() == NS  # every digit
        assert np.isnan(recording.orientation[0]).all() and recording.orientation[2].tolist() == [0.6, 0.8, 0.0, 0.0]


def test_repoimu_with_two_lines_of_header(tmp_path):
    path = tmp_path / "TStick_Test02_Trial1.csv"
    turned = np.tile([1.0, 0.0, 0.0, 0.0], (N, 1))
    path.write_text(lines(REPO, rows(SECONDS, turned, ACCEL, GYRO, np.ones((N, 3))), ";"), encoding="utf-8")
    recording = read_recording(path)
    check(recording)
    assert recording.orientation[3].tolist() == [1.0, 0.0, 0.0, 0.0]


def test_x_imu3_in_degrees_and_g(tmp_path):
    path = tmp_path / "inertial.csv"
    times = [1000 + 5000 * k for k in range(N)]
    path.write_text(lines(XIMU3, rows(times, np.degrees(GYRO), ACCEL / STANDARD_GRAVITY, np.ones((N, 3)))), encoding="utf-8")
    recording = read_recording(path)
    check(recording)
    assert "the gyroscope is in deg/s by its header: converted" in recording.notes


def test_x_imu_needs_a_rate(tmp_path):
    path, mapping = tmp_path / "CalInertialAndMag.csv", tmp_path / "columns.yaml"
    path.write_text(lines(XIMU, rows(range(N), np.degrees(GYRO), ACCEL / STANDARD_GRAVITY, np.ones((N, 3)))), encoding="utf-8")
    with pytest.raises(RecordingError, match=r"no column of time among Packet number.*rate"):
        read_recording(path)
    gyro, accel = (
        [f"{name} {axis} ({unit})" for axis in "XYZ"] for name, unit in (("Gyroscope", "deg/s"), ("Accelerometer", "g"))
    )
    mapping.write_text(f"rate: 200\ngyro: {gyro}\ngyro_unit: deg/s\naccel: {accel}\naccel_unit: g\n", encoding="utf-8")
    check(read_recording(path, columns=read_mapping(str(mapping))))


def logger_files(folder, accel):
    folder.mkdir()
    (folder / "Gyroscope.csv").write_text(lines(LOGGER, rows(NS, SECONDS, GYRO[:, ::-1])), encoding="utf-8")
    for name, values in accel.items():
        (folder / f"{name}.csv").write_text(lines(LOGGER, rows(NS, SECONDS, values[:, ::-1])), encoding="utf-8")
    (folder / "Metadata.csv").write_text("version,device name\n3,phone\n", encoding="utf-8")
    return folder


def test_sensor_logger_with_and_without_total_acceleration(tmp_path):
    gravity = np.tile([0.0, 0.0, STANDARD_GRAVITY], (N, 1))
    check(read_recording(logger_files(tmp_path / "a", {"Accelerometer": ACCEL - gravity, "Gravity": gravity})))
    check(
        read_recording(
            logger_files(tmp_path / "b", {"TotalAcceleration": ACCEL, "Accelerometer": ACCEL - gravity, "Gravity": gravity})
        )
    )


@pytest.mark.parametrize(
    ("time", "accel", "gyro", "separator", "comma"),
    [
        ("Time (s)", "Acceleration {} (m/s^2)", "Gyroscope {} (rad/s)", ",", False),
        ("Time (s)", "Acceleration {} (m/s^2)", "Gyroscope {} (rad/s)", "\t", True),
        ("Zeit (s)", "Beschleunigung {} (m/s²)", "Winkelgeschwindigkeit {} (rad/s)", ";", True),
        ("Temps (s)", "Accélération {} (m/s^2)", "Gyroscope {} (rad/s)", ";", True),
    ],
)
def test_phyphox_in_several_languages_and_with_decimal_commas(tmp_path, time, accel, gyro, separator, comma):
    later = [t + 0.0007 for t in SECONDS]  # the sensors of a phone do not measure at the same moments
    at = np.stack([np.interp(later, SECONDS, column) for column in ACCEL.T], axis=1)

    def header(name):
        return separator.join([time, *(name.format(axis) for axis in "xyz")])

    (tmp_path / "Gyroscope.csv").write_text(lines(header(gyro), rows(SECONDS, GYRO), separator, comma), encoding="utf-8")
    (tmp_path / "Accelerometer.csv").write_text(lines(header(accel), rows(later, at), separator, comma), encoding="utf-8")
    recording = read_recording(tmp_path)
    assert len(recording) == N - 1 and recording.accel[:-1] == pytest.approx(ACCEL[1:-1], abs=1e-6)
    assert recording.gyro == pytest.approx(GYRO[1:])


@pytest.mark.parametrize(
    "names", ["t,gx,gy,gz,ax,ay,az", "timestamp,gyro_x,gyro_y,gyro_z,acc_x,acc_y,acc_z", "Time,GyroX,GyroY,GyroZ,AccX,AccY,AccZ"]
)
@pytest.mark.parametrize("unit", [1.0, 1e3, 1e6, 1e9])
def test_usual_names_in_any_unit_of_time(tmp_path, names, unit):
    (tmp_path / "a.csv").write_text(lines(names, rows([round(unit * t, 6) for t in SECONDS], GYRO, ACCEL)), encoding="utf-8")
    check(read_recording(tmp_path / "a.csv"))


STRANGERS = {
    "units at the end of names": ("timestamp_us,gyro_x_dps,gyro_y_dps,gyro_z_dps,acc_x_g,acc_y_g,acc_z_g", 1e6, "deg", "g"),
    "other units": ("time_ns,wx_rad_s,wy_rad_s,wz_rad_s,ax_mg,ay_mg,az_mg", 1e9, "rad", "mg"),
    "units spelt out": ("Epoch (ms),GyroX [deg/sec],GyroY [deg/sec],GyroZ [deg/sec],AccX [g],AccY [g],AccZ [g]", 1e3, "deg", "g"),
    "milli-degrees": ("t [s],Gyr X {mdps},Gyr Y {mdps},Gyr Z {mdps},Acc X {m/s2},Acc Y {m/s2},Acc Z {m/s2}", 1.0, "mdeg", ""),
    "a line of units": ("t,gx,gy,gz,ax,ay,az\nms,deg/s,deg/s,deg/s,g,g,g", 1e3, "deg", "g"),
    "a line of units in brackets": ("t,gx,gy,gz,ax,ay,az\n[s],[°/s],[°/s],[°/s],[m/s²],[m/s²],[m/s²]", 1.0, "deg", ""),
    "axis first": ("time,x_gyro,y_gyro,z_gyro,X-axis acceleration,Y-axis acceleration,Z-axis acceleration", 1.0, "rad", ""),
    "the names of ROS": (
        "%time,field.angular_velocity.x,field.angular_velocity.y,field.angular_velocity.z,"
        "field.linear_acceleration.x,field.linear_acceleration.y,field.linear_acceleration.z", 1e9, "rad", ""),
    "comments": ("# device: 12\n# rate, 200\n#\n% made by hand\nt,gx,gy,gz,ax,ay,az", 1.0, "rad", ""),
    "the line of a spreadsheet": ("sep=,\nt,gx,gy,gz,ax,ay,az", 1.0, "rad", ""),
    "Chinese": ("时间(s),角速度X(deg/s),角速度Y(deg/s),角速度Z(deg/s),加速度X(g),加速度Y(g),加速度Z(g)", 1.0, "deg", "g"),
    "Chinese units": (
        "时间(毫秒),陀螺x(度/秒),陀螺y(度/秒),陀螺z(度/秒),加速度x(米/秒²),加速度y(米/秒²),加速度z(米/秒²)", 1e3, "deg", ""),
    "Russian units": (
        "Время (с),Гироскоп X (рад/с),Гироскоп Y (рад/с),Гироскоп Z (рад/с),"
        "Ускорение X (м/с²),Ускорение Y (м/с²),Ускорение Z (м/с²)", 1.0, "rad", ""),
    "Polish": ("czas [ms],żyroskop x,żyroskop y,żyroskop z,przyspieszenie x,przyspieszenie y,przyspieszenie z", 1e3, "rad", ""),
    "Spanish": ("Tiempo (s),Giroscopio x,Giroscopio y,Giroscopio z,Aceleración x,Aceleración y,Aceleración z", 1.0, "rad", ""),
    "quotes": ('"t","gx","gy","gz","ax","ay","az"', 1.0, "rad", ""),
    "paths of PlotJuggler": (
        "__time,/imu/angular_velocity/x,/imu/angular_velocity/y,/imu/angular_velocity/z,"
        "/imu/linear_acceleration/x,/imu/linear_acceleration/y,/imu/linear_acceleration/z", 1.0, "rad", ""),
    "the counter of Xsens": ("SampleTimeFine,Gyr_X,Gyr_Y,Gyr_Z,Acc_X,Acc_Y,Acc_Z", 1e4, "rad", ""),
    "the counter of Movella": ("SampleTimeFine,Gyr_X,Gyr_Y,Gyr_Z,Acc_X,Acc_Y,Acc_Z", 1e6, "rad", ""),
    "spaces": ("t, gx, gy, gz, ax, ay, az", 1.0, "rad", ""),
}  # fmt: skip
IN_SI = {"rad": 1.0, "deg": np.pi / 180.0, "mdeg": np.pi / 180e3, "": 1.0, "g": STANDARD_GRAVITY, "mg": 1e-3 * STANDARD_GRAVITY}


@pytest.mark.parametrize("name", STRANGERS)
def test_headers_of_strangers_say_what_the_columns_are(tmp_path, name):
    header, scale, rate, force = STRANGERS[name]
    times = [round(scale * (1000.0 + t)) if scale > 1.0 else t for t in SECONDS]
    (tmp_path / "a.csv").write_text(lines(header, rows(times, GYRO / IN_SI[rate], ACCEL / IN_SI[force])), encoding="utf-8")
    check(read_recording(tmp_path / "a.csv"))


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1"])
@pytest.mark.parametrize(
    ("separator", "comma", "end"), [(";", True, "\n"), ("\t", False, "\r\n"), ("|", False, "\n"), (" ", True, "\n")]
)
def test_encodings_separators_and_ends_of_lines(tmp_path, encoding, separator, comma, end):
    header = separator.join(["Zeit", "gx", "gy", "gz", "ax", "ay", "az"])
    text = lines(header, rows(SECONDS, GYRO, ACCEL), separator, comma).replace("\n", "\n\n" + end, 2).replace("\n", end)
    (tmp_path / "a.txt").write_bytes(text.encode(encoding))
    check(read_recording(tmp_path / "a.txt"))


def test_columns_in_another_order_with_gaps_and_a_separator_at_the_end(tmp_path):
    table = rows(ACCEL[:, ::-1], [""] * N, GYRO[:, ::-1], SECONDS, [""] * N)
    (tmp_path / "a.csv").write_text(lines("az,ay,ax,note,gz,gy,gx,t", table), encoding="utf-8")
    check(read_recording(tmp_path / "a.csv"))


@pytest.mark.parametrize("first", ["PacketID", "loggingTime(txt)", "timestamp (+0100)"])
def test_a_column_that_is_no_usable_time_is_passed_over(tmp_path, first):
    (tmp_path / "a.csv").write_text(
        lines(f"{first},elapsed (s),gx,gy,gz,ax,ay,az", rows(range(N), SECONDS, GYRO, ACCEL)), encoding="utf-8"
    )
    check(read_recording(tmp_path / "a.csv"))


def test_a_magnetometer_is_no_accelerometer(tmp_path):
    with pytest.raises(RecordingError, match=r"found: Gyroscope\.csv, Magnetometer\.csv, Metadata\.csv"):
        read_recording(logger_files(tmp_path / "a", {"Magnetometer": ACCEL}))


def test_seconds_and_nanoseconds_in_two_columns(tmp_path):
    header = "header.stamp.sec,header.stamp.nanosec,gx,gy,gz,ax,ay,az"
    table = rows([t // 10**9 for t in NS], [t % 10**9 for t in NS], GYRO, ACCEL)
    (tmp_path / "a.csv").write_text(lines(header, table), encoding="utf-8")
    recording = read_recording(tmp_path / "a.csv")
    check(recording)
    assert recording.stamp_ns.tolist() == NS


@pytest.mark.parametrize("form", ["2026-03-01 12:00:0{:.3f}", "2026-03-01T12:00:0{:.3f}Z", "12:00:0{:.3f}"])
def test_times_of_a_clock(tmp_path, form):
    (tmp_path / "a.csv").write_text(
        lines("time,gx,gy,gz,ax,ay,az", rows([form.format(t) for t in SECONDS], GYRO, ACCEL)), encoding="utf-8"
    )
    check(read_recording(tmp_path / "a.csv"))


def test_the_last_line_may_be_cut_off(tmp_path):
    (tmp_path / "a.csv").write_text(lines("t,gx,gy,gz,ax,ay,az", rows(SECONDS, GYRO, ACCEL)) + "0.03,0.1,", encoding="utf-8")
    check(read_recording(tmp_path / "a.csv"))


MISTAKES = [
    ("t,gx,gy,gz\n0,1,2,3\n1,1,2,3\n", "lacks a specific force; found the columns: t, gx, gy, gz; needed: time, rate"),
    (
        "t,gx,gy,gz,linear acceleration x,linear acceleration y,linear acceleration z\n0,1,2,3,4,5,6\n",
        "acceleration without gravity",
    ),
    ("t,gx (lsb),gy (lsb),gz (lsb),ax,ay,az\n0,1,2,3,4,5,6\n", r"column 'gx \(lsb\)' is in 'lsb'; known units: rad/s"),
    ("t,gx,gy,gz,ax,ay,az\n0,0,0,1,0,2,0,3,0,4,0,5,0,6\n", "commas are separators and decimal points at once"),
    (
        "t,gx,gy,gz,ax,ay,az\n0,1,2,3,4,5,6\n0.01,1,2,3,4,5\n0.02,1,2,3,4,5,6\n",
        "row 2 of the numbers has 6 fields; the first has 7",
    ),
    ("t,gx,gy,gz,ax,ay,az\n0,1,2,3,4,5,6\n", "has 1 IMU samples"),
    ("hello\nworld\n", "no line of numbers"),
    ("t [s] gx gy gz ax ay az [g]\n0 1 2 3 4 5 6\n1 1 2 3 4 5 6\n", r"header names 9 columns.* have 7 fields: t, \[s\], gx"),
    ("t;gx;gy;gz;ax;ay;az\n1;0;1;2;3;4;5;6\n2;1;1;2;3;4;5;6\n", "header names 7 columns.* have 8 fields"),
    ("t,gx,gy,gz,ax,ay,az\n0.2,1,2,3,4,5,6\n0.1,1,2,3,4,5,6\n", "the time does not advance: it goes from 0.2 to 0.1"),
    ("sec,nanosec,gx,gy,gz,ax,ay,az\n0,0,1,2,3,4,5,6\n0,-,1,2,3,4,5,6\n", "column 'nanosec' is no number in row 2"),
    ("t,gx,gy,gz,ax,ay,az\n12:00:01,1,2,3,4,5,6\n(stop),1,2,3,4,5,6\n", r"column 't' is no time of a clock in row 2: '\(stop\)'"),
    ("", "is empty; a header and lines of numbers are needed"),
    ("\n\n  \n", "is empty"),
    ("t,gx,gy,gz,ax,ay,az\n", "no line of numbers among the first 1"),
    ("t,gx (rad/s),gy (deg/s),gz (rad/s),ax,ay,az\n0,1,2,3,4,5,6\n", "of one sensor are in different units"),
    ("t,gx,gy,ax,ay,az\n0,1,2,3,4,5\n1,1,2,3,4,5\n", "lacks a rate; found the columns: t, gx, gy, ax, ay, az"),
    ("\x00\x01\x02\x03PNG\n\x00\x00", "no line of numbers"),
    ('t,gx,gy,gz,ax,ay,az\n0,"1,2,3,4,5,6\n', "no line of numbers"),
]


@pytest.mark.parametrize(("text", "words"), MISTAKES)
def test_an_unusable_file_is_refused_with_what_was_found(tmp_path, text, words):
    (tmp_path / "bad.csv").write_text(text, encoding="utf-8")
    with pytest.raises(RecordingError, match=words) as refusal:
        read_recording(tmp_path / "bad.csv")
    assert "bad.csv" in str(refusal.value)


def test_a_mapping_with_a_wrong_name_or_unit_is_refused(tmp_path):
    (tmp_path / "a.csv").write_text(lines("t,gx,gy,gz,ax,ay,az", rows(SECONDS, GYRO, ACCEL)), encoding="utf-8")
    (tmp_path / "map.yaml").write_text("time: t\ngyro: [gx, gy, wz]\naccel: [ax, ay, az]\n", encoding="utf-8")
    with pytest.raises(RecordingError, match="no column 'wz'; found: t, gx"):
        read_recording(tmp_path / "a.csv", columns=read_mapping(str(tmp_path / "map.yaml")))
    (tmp_path / "map.yaml").write_text("gyro: [gx, gy, gz]\naccel: [ax, ay, az]\naccel_unit: ounces\n", encoding="utf-8")
    with pytest.raises(ConfigError, match="accel_unit is 'ounces'; allowed"):
        read_mapping(str(tmp_path / "map.yaml"))
