"""Writes the tables and bags of other programs in corpus/, by openpyxl, XlsxWriter, nptdms, pandas, pyarrow and
rosbags.

    pip install openpyxl XlsxWriter nptdms pandas pyarrow rosbags lz4
    python fuzz/make_tables.py

Row n has the numbers that the tests of rigident-io compute by themselves (csv/exports_tests.rs): the time is
2 n ms; column k (fx 1 ... mz 6) is `value(n, k)`.
"""

import datetime
import pathlib

import numpy as np

ROWS = 40
NAMES = ["Fx", "Fy", "Fz", "Mx", "My", "Mz"]
UNITS = ["N", "N", "N", "Nm", "Nm", "Nm"]
TABLES = pathlib.Path(__file__).parent / "corpus" / "recording_table"


def thousandths(row, k):
    if k == 1:
        return 1_234_567 + 17 * row
    if k == 3:
        return -2_000_500 - row
    return (row * 37 + k * 101) % 4001 - 2000


def value(row, k):
    return thousandths(row, k) / 1000


def openpyxl_sheet():
    import openpyxl

    book = openpyxl.Workbook()
    cover = book.active
    cover.title = "Deckblatt"
    cover.append(["Prüfling", "Halter 4711"])
    cover.append(["Prüfer", "M. Muster"])
    sheet = book.create_sheet("Messung 1")
    sheet.append(["Prüfling:", 'Halter "4711"'])
    sheet.append(["Datum:", datetime.date(2026, 11, 20)])
    sheet.append([])
    sheet.append(["Zeit", *[f"Kraft {a}" for a in "XYZ"], *[f"Moment {a}" for a in "XYZ"], "Bemerkung"])
    sheet.append([None, *[f"[{u}]" for u in UNITS]])
    start = datetime.datetime(2026, 11, 20, 10, 12, 33)
    for row in range(ROWS):
        stamp = start + datetime.timedelta(milliseconds=2 * row)
        sheet.append([stamp, *[value(row, k) for k in range(1, 7)], "Start" if row == 0 else None])
        sheet.cell(sheet.max_row, 1).number_format = "dd.mm.yyyy hh:mm:ss.000"
    book.save(TABLES / "openpyxl.xlsx")


def xlsxwriter_sheet():
    import pandas

    columns = {"Time [ms]": [2 * row for row in range(ROWS)]}
    for k, (name, unit) in enumerate(zip(NAMES, UNITS), 1):
        columns[f"{name} [{unit}]"] = [value(row, k) for row in range(ROWS)]
    table = pandas.DataFrame(columns)
    with pandas.ExcelWriter(TABLES / "pandas.xlsx", engine="xlsxwriter") as writer:
        table.to_excel(writer, sheet_name="run 1", index=False)
        table.to_excel(writer, sheet_name="run 2", index=False)
    # Numbers as text, decimals with a comma: those of a program that knows no numbers.
    text = table.map(lambda v: f"{v:.3f}".replace(".", ",") if isinstance(v, float) else v)
    text["Note"] = ["0,5"] * ROWS
    with pandas.ExcelWriter(TABLES / "text_cells.xlsx", engine="xlsxwriter") as writer:
        text.to_excel(writer, sheet_name="run", index=False)
    for name in text.columns[1:]:
        text[name] = [f"1,{500 + row}" for row in range(ROWS)]
    with pandas.ExcelWriter(TABLES / "unclear_cells.xlsx", engine="xlsxwriter") as writer:
        text.to_excel(writer, sheet_name="run", index=False)


# Name, separator, decimal mark, mark between thousands, date and time.
LOCALES = [
    ("de", ";", ",", ".", "%d.%m.%Y %H:%M:%S"),
    ("fr", ";", ",", "\u202f", "%d.%m.%Y %H:%M:%S"),
    ("ch", ";", ".", "'", "%d.%m.%Y %H:%M:%S"),
    ("us", ",", ".", ",", "%m/%d/%Y %I:%M:%S"),
    ("gb", "\t", ".", ",", "%Y-%m-%d %H:%M:%S"),
    ("pl", ";", ",", "\u00a0", "%Y-%m-%d %H:%M:%S"),
]


def tables_of_text():
    """Five tables in each of six locales, by pandas: as it writes them, in UTF-16, in Windows-1252, quoted under a
    preamble, and with dates."""
    import csv

    import pandas

    folder = TABLES.parent / "recording_csv"
    start = datetime.datetime(2026, 11, 20, 10, 12, 33)
    for name, separator, decimal, thousands, date in LOCALES:
        def written(thousandth):
            whole, rest = divmod(abs(thousandth), 1000)
            sign = "-" if thousandth < 0 else ""
            return f"{sign}{whole:,}".replace(",", thousands) + f"{decimal}{rest:03}"

        def stamp(row):
            moment = start + datetime.timedelta(milliseconds=2 * row)
            clock = f"{decimal}{moment.microsecond // 1000:03}"
            return moment.strftime(date) + clock + (" AM" if "%I" in date else "")

        columns = {"Time [s]": [written(2 * row) for row in range(ROWS)]}
        for k, (column, unit) in enumerate(zip(NAMES, UNITS), 1):
            columns[f"{column} [{unit}]"] = [written(thousandths(row, k)) for row in range(ROWS)]
        table = pandas.DataFrame(columns)
        options = {"sep": separator, "index": False}
        table.to_csv(folder / f"pandas_{name}", **options)
        table.to_csv(folder / f"pandas_{name}_utf16", encoding="utf-16", **options)
        narrow = table.map(lambda cell: cell.replace("\u202f", "\u00a0"))
        narrow["Gerät"] = "Prüfstand"
        narrow.to_csv(folder / f"pandas_{name}_cp1252", encoding="cp1252", lineterminator="\r\n", **options)
        text = table.to_csv(quoting=csv.QUOTE_ALL, **options)
        preamble = f"Prüfling{separator}Halter 4711\nDatum{separator}20.11.2026\n\n"
        (folder / f"pandas_{name}_quoted").write_text(preamble + text, encoding="utf-8")
        dated = table.rename(columns={"Time [s]": "Time"}).assign(Time=[stamp(row) for row in range(ROWS)])
        dated.to_csv(folder / f"pandas_{name}_dates", **options)


def tdms_files():
    from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter
    from nptdms.types import Int32, Uint32

    root = RootObject({"Operator": "M. Muster"})
    start = np.datetime64("2026-11-20T10:12:33.000000")
    with TdmsWriter(TABLES / "waveform.tdms") as writer:
        for rows in (range(25), range(25, ROWS)):
            channels = []
            for k, (name, unit) in enumerate(zip(NAMES, UNITS), 1):
                properties = {
                    "unit_string": unit,
                    "wf_increment": 0.002,
                    "wf_start_offset": 0.0,
                    "wf_start_time": start,
                }
                data = np.array([value(row, k) for row in rows])
                channels.append(ChannelObject("Load cell", name, data, properties))
            settings = ChannelObject("Settings", "gain", np.array([1.0, 2.0]))
            writer.write_segment([root, GroupObject("Load cell"), *channels, *([settings] if rows[0] == 0 else [])])
    with TdmsWriter(TABLES / "scaled.tdms") as writer:
        channels = [
            ChannelObject("run", "Zeit", np.array([start + np.timedelta64(2 * row, "ms") for row in range(ROWS)])),
            ChannelObject("run", "note", [f"row {row}" for row in range(ROWS)]),
        ]
        for k, (name, unit) in enumerate(zip(NAMES, UNITS), 1):
            data = np.array([thousandths(row, k) for row in range(ROWS)], np.int32)
            properties = {
                "unit_string": unit,
                "NI_Number_Of_Scales": Int32(1),
                "NI_Scaling_Status": "unscaled",
                "NI_Scale[0]_Scale_Type": "Linear",
                "NI_Scale[0]_Linear_Slope": 0.001,
                "NI_Scale[0]_Linear_Y_Intercept": 0.25,
                "NI_Scale[0]_Linear_Input_Source": Uint32(0xFFFFFFFF),
            }
            channels.append(ChannelObject("run", name, data, properties))
        writer.write_segment([root, *channels])
    # As DAQmx has them: the first scale is that of the converter, of which nothing is stated.
    with TdmsWriter(TABLES / "second_scale.tdms") as writer:
        channels = []
        for k, (name, unit) in enumerate(zip(NAMES, UNITS), 1):
            data = np.array([thousandths(row, k) for row in range(ROWS)], np.int32)
            properties = {
                "unit_string": unit,
                "wf_increment": 0.002,
                "NI_Number_Of_Scales": Int32(2),
                "NI_Scaling_Status": "unscaled",
                "NI_Scale[1]_Scale_Type": "Linear",
                "NI_Scale[1]_Linear_Slope": 0.001,
                "NI_Scale[1]_Linear_Y_Intercept": 0.25,
                "NI_Scale[1]_Linear_Input_Source": Uint32(0),
            }
            channels.append(ChannelObject("run", name, data, properties))
        writer.write_segment([root, *channels])


def tdms_of_daqmx():
    """Counts of two devices, after NI's description of the format; nptdms, which cannot write them, reads them back."""
    import struct

    from nptdms import TdmsFile

    def text(words):
        return struct.pack("<I", len(words)) + words.encode()

    def properties(own):
        out = struct.pack("<I", len(own))
        for name, kind, value in own:
            packed = text(value) if kind == 0x20 else struct.pack({3: "<i", 7: "<I", 10: "<d"}[kind], value)
            out += text(name) + struct.pack("<I", kind) + packed
        return out

    def channel(name, samples, code, scaler, own):
        index = struct.pack("<IIIQI", code, 0xFFFFFFFF, 1, samples, 1) + scaler + struct.pack("<III", 2, 17, 8)
        return text(f"/'run'/'{name}'") + index + properties(own)

    half = ROWS // 2
    meta = struct.pack("<I", 8) + text("/'run'") + struct.pack("<II", 0xFFFFFFFF, 0)
    for k, (name, unit) in enumerate(zip(NAMES, UNITS), 1):
        buffer, place = (0, 4 * (k - 1)) if k <= 4 else (1, 4 * (k - 5))
        own = [
            ("unit_string", 0x20, unit),
            ("wf_increment", 10, 0.002),
            ("NI_Number_Of_Scales", 7, 2),
            ("NI_Scaling_Status", 0x20, "unscaled"),
            ("NI_Scale[1]_Scale_Type", 0x20, "Polynomial"),
            ("NI_Scale[1]_Polynomial_Coefficients_Size", 7, 4),
            *[(f"NI_Scale[1]_Polynomial_Coefficients[{n}]", 10, c) for n, c in enumerate([0.25, 0.001, 0.0, 0.0])],
            ("NI_Scale[1]_Polynomial_Input_Source", 7, 0),
        ]
        meta += channel(name, half, 0x1269, struct.pack("<IIIII", 5, buffer, place, 0, 0), own)
    # Bit 3 of the seventeenth byte.
    meta += channel("gate", half, 0x126A, struct.pack("<IIIBI", 0, 0, 16 * 8 + 3, 0, 0), [("wf_increment", 10, 0.002)])
    counts = lambda row, ks: struct.pack(f"<{len(ks)}i", *[thousandths(row, k) for k in ks])
    raw = b""
    for rows in (range(half), range(half, ROWS)):
        raw += b"".join(counts(row, [1, 2, 3, 4]) + bytes([0xF7 | (row % 2) << 3]) for row in rows)
        raw += b"".join(counts(row, [5, 6]) for row in rows)
    contents = (1 << 1) | (1 << 2) | (1 << 3) | (1 << 7)
    lead = b"TDSm" + struct.pack("<IIQQ", contents, 4713, len(meta) + len(raw), len(meta))
    (TABLES / "daqmx.tdms").write_bytes(lead + meta + raw)
    group = TdmsFile.read(TABLES / "daqmx.tdms")["run"]
    for k, name in enumerate(NAMES, 1):
        wanted = [thousandths(row, k) * 0.001 + 0.25 for row in range(ROWS)]
        assert np.allclose(group[name][:], wanted, rtol=0, atol=1e-9), name
    assert list(group["gate"].raw_data) == [row % 2 for row in range(ROWS)]


def parquet_decimals():
    """Decimals of 4, 8 and 16 bytes, and such that are stored as whole numbers, by pyarrow."""
    import decimal

    import pyarrow
    import pyarrow.parquet

    def column(digits, numbers):
        kind = pyarrow.decimal128(digits, 3)
        return pyarrow.array([decimal.Decimal(n) / 1000 for n in numbers], kind)

    columns = {"Time [s]": column(9, [2 * row for row in range(ROWS)])}
    for k, (name, unit) in enumerate(zip(NAMES, UNITS), 1):
        columns[f"{name} [{unit}]"] = column([9, 18, 38][k % 3], [thousandths(row, k) for row in range(ROWS)])
    table = pyarrow.table(columns)
    for name, whole in (("decimals", False), ("decimals_whole", True)):
        pyarrow.parquet.write_table(
            table, TABLES / f"{name}.parquet", compression="zstd", store_decimal_as_integer=whole, store_schema=False
        )


def ros1_bags():
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    transforms = "geometry_msgs/TransformStamped[] transforms"
    store.register(get_types_from_msg(transforms, "tf2_msgs/msg/TFMessage"))
    types = store.types

    def kind(name):
        return types[name]

    def header(ns, seq):
        stamp = kind("builtin_interfaces/msg/Time")(sec=ns // 10**9, nanosec=ns % 10**9)
        return kind("std_msgs/msg/Header")(seq=seq, stamp=stamp, frame_id="tool0")

    vector = kind("geometry_msgs/msg/Vector3")
    turn = kind("geometry_msgs/msg/Quaternion")(x=0.0, y=0.0, z=0.0, w=1.0)
    for name, packing in (("ros1", None), ("ros1_bz2", "BZ2"), ("ros1_lz4", "LZ4")):
        path = TABLES.parent / "recording_bag" / f"{name}.bag"
        path.unlink(missing_ok=True)
        writer = Writer(path)
        if packing:
            writer.set_compression(Writer.CompressionFormat[packing])
        with writer:
            topics = {}
            for topic, of in (
                ("/ft", "geometry_msgs/msg/WrenchStamped"),
                ("/imu", "sensor_msgs/msg/Imu"),
                ("/joint_states", "sensor_msgs/msg/JointState"),
                ("/tf", "tf2_msgs/msg/TFMessage"),
                ("/chatter", "std_msgs/msg/String"),
            ):
                topics[topic] = writer.add_connection(topic, of, typestore=store)
            for row in range(ROWS):
                ns = 1_795_169_553_000_000_000 + 2_000_000 * row
                w = [(10 * row + k) / 8 for k in range(6)]
                head = header(ns, row)
                wrench = kind("geometry_msgs/msg/Wrench")(force=vector(*w[:3]), torque=vector(*w[3:]))
                sigma = np.full(9, 0.25)
                messages = {
                    "/ft": kind("geometry_msgs/msg/WrenchStamped")(header=head, wrench=wrench),
                    "/imu": kind("sensor_msgs/msg/Imu")(
                        header=head,
                        orientation=turn,
                        orientation_covariance=sigma,
                        angular_velocity=vector(row / 10, -0.25, 0.125),
                        angular_velocity_covariance=sigma,
                        linear_acceleration=vector(float(row), -7.5, 9.5),
                        linear_acceleration_covariance=sigma,
                    ),
                    "/joint_states": kind("sensor_msgs/msg/JointState")(
                        header=head,
                        name=["shoulder", "elbow"],
                        position=np.array([0.5, row + 0.25]),
                        velocity=np.array([0.0, 1.0]),
                        effort=np.array([2.0, -float(row)]),
                    ),
                    "/tf": kind("tf2_msgs/msg/TFMessage")(
                        transforms=[
                            kind("geometry_msgs/msg/TransformStamped")(
                                header=head,
                                child_frame_id="tool0",
                                transform=kind("geometry_msgs/msg/Transform")(
                                    translation=vector(row / 8, 0.0, 1.0), rotation=turn
                                ),
                            )
                        ]
                    ),
                    "/chatter": kind("std_msgs/msg/String")(data=f"row {row}"),
                }
                for topic, message in messages.items():
                    connection = topics[topic]
                    writer.write(connection, ns, store.serialize_ros1(message, connection.msgtype))


if __name__ == "__main__":
    openpyxl_sheet()
    xlsxwriter_sheet()
    tables_of_text()
    tdms_files()
    tdms_of_daqmx()
    parquet_decimals()
    ros1_bags()
