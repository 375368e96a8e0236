"""XML in other encodings, and with what ROS's own parser takes; each of the first kind is a public report."""

import time

import pytest

from robots.descriptions.description import load
from robots.kinematics.joints import joints_of
from robots.schema.errors import DescriptionError, ShapeError
from robots.schema.xml_text import XmlError, read_xml
from robots.shapes.files.read import read_geometry
from tests.robots.test_shape_formats import DAE

LATIN = '<?xml version="1.0" encoding="ISO-8859-1"?>\n<robot name="bras_école"/>'
CHINESE = '<?xml version="1.0" encoding="%s"?>\n<robot name="大臂"/>'


@pytest.mark.parametrize(
    ("data", "name"),
    [
        (LATIN.encode("latin-1"), "bras_école"),
        (LATIN.replace("ISO-8859-1", "windows-1252").encode("cp1252"), "bras_école"),
        ((CHINESE % "GB2312").encode("gbk"), "大臂"),
        ((CHINESE % "Shift_JIS").replace("臂", "腕").encode("shift_jis"), "大腕"),
        ((CHINESE % "utf-8").encode("utf-8-sig"), "大臂"),
        # A mark has precedence over a declaration that another program left.
        ((CHINESE % "GBK").encode("utf-16"), "大臂"),
        ((CHINESE % "utf-8").encode("utf-16-be"), "大臂"),
        ((CHINESE % "utf-8").encode("utf-32"), "大臂"),
        ((CHINESE % "utf-16").encode(), "大臂"),
        (CHINESE % "utf-16", "大臂"),
        ('\n\n<robot name="大臂"/>'.encode(), "大臂"),
        ('<!----><robot name="大臂"/><!-- 大臂 - -->'.encode(), "大臂"),
    ],
)
def test_the_mark_then_the_declaration_then_utf8_give_the_encoding(data, name):
    root, notes = read_xml(data)
    assert (root.tag, root.get("name"), notes) == ("robot", name, ())


@pytest.mark.parametrize(
    ("data", "note"),
    [
        (b'<robot>\n<!-- arm \x96 2,\n 90\xb0 --></robot>', "line 2: this comment has bytes that are not"),
        (b"<robot>\n\n<!-- ---- base ---- --></robot>", "line 3: this comment has --, which XML"),
        (b"<robot><!--a---></robot>", "line 1: this comment has --, which XML does not allow"),
        (b'<!DOCTYPE robot SYSTEM "robot.dtd"><robot/>', "its DOCTYPE is ignored"),
    ],
)  # fmt: skip
def test_an_irregularity_outside_of_the_content_is_a_note(data, note):
    root, (found,) = read_xml(data)
    assert root.tag == "robot"
    assert found.startswith(note)


def test_prefixes_need_no_declaration_and_cdata_is_text():
    text = '<robot xmlns="http://a"><gz:plugin gz:type="b"><![CDATA[<!-- -- &amp;]]></gz:plugin></robot>'
    root, notes = read_xml(text)
    (plugin,) = root
    assert (root.tag, plugin.tag, plugin.get("gz:type"), plugin.text, notes) == (
        ("robot", "gz:plugin", "b", "<!-- -- &amp;", ())
    )


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b'<robot name="a"/>\n\xff', "line 2: byte 0xff is not utf-8 text: declare the file's encoding"),
        (b'<?xml version="1.0" encoding="klingon"?><a/>', "declares the encoding 'klingon', which"),
        (b'<?xml version="1.0" encoding="punycode"?><a/>', "declares the encoding 'punycode'"),
        (b'<?xml version="1.0" encoding="unicode_escape"?><a/>', "declares the encoding 'unicode_escape'"),
        (b'<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "has a DOCTYPE with declarations"),
        (b'<!DOCTYPE a [<!ELEMENT a ANY>]><a/>', "has a DOCTYPE with declarations"),
        (b'<!DOCTYPE a SYSTEM "a.dtd"><a>&b;</a>', "has a DOCTYPE with declarations, or an ENTITY"),
        (b'<?b <!-- ?><!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a><?c --> ?>', "has a DOCTYPE with declarations"),
        (b"<a>&b;</a>", "is not XML: undefined entity: line 1"),
        (b"<a>\n<!-- <b/></a>", "is not XML: .*line 2"),
        (b"<a>\n\n<b></a>", "is not XML: mismatched tag: line 3"),
        (b"", "is not XML: no element found"),
        ("<a>\ud800</a>", "is not XML"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_refused_with_its_place(data, words):
    with pytest.raises(XmlError, match=words):
        read_xml(data)


@pytest.mark.parametrize("part", [b"<!--", b"<![CDATA[", b"<!", b"<!---->", b"<!--a--b-->\n"])
def test_a_repeated_part_of_a_comment_takes_linear_time(part):
    times = []
    for count in (20_000, 160_000):
        data = b"<a>" + part * count
        began = time.process_time()
        with pytest.raises(XmlError):
            read_xml(data)
        times.append(time.process_time() - began)
    assert times[1] < 32 * times[0] + 0.2


@pytest.mark.parametrize("encoding", ["utf-8", "GBK", "utf-16"])
def test_a_collada_shape_is_read_in_its_own_encoding(tmp_path, encoding):
    path = tmp_path / "a.dae"
    text = DAE.partition("?>")[2].lstrip()
    text = f'<?xml version="1.0" encoding="{encoding}"?>\n<!-- 大臂 -- 2 -->\n{text}'
    path.write_bytes(text.encode(encoding))
    assert read_geometry(path).triangle_count > 0


def test_what_a_collada_file_hides_from_the_check_is_not_read(tmp_path):
    path = tmp_path / "a.dae"
    entity = '<?a <!-- ?><!DOCTYPE COLLADA [<!ENTITY x "1">]><?b --> ?>'
    path.write_text(DAE.replace("<COLLADA", f"{entity}<COLLADA", 1))
    with pytest.raises(ShapeError, match="DOCTYPE"):
        read_geometry(path)


@pytest.mark.parametrize(
    ("encoding", "declared", "more"),
    [
        ("cp1252", ' encoding="utf-8"', "<!-- arm \u2013 version 2, 90° -->"),
        ("gbk", ' encoding="GB2312"', '<material name="底座"/>'),
        ("latin-1", ' encoding="ISO-8859-1"', '<material name="école"/>'),
        ("utf-16", "", ""),
        ("utf-8", "", "<!-- ------ base ------ -->"),
        ("utf-8", "", '<gazebo reference="b"><sensor:camera name="cam"/></gazebo>'),
        ("utf-8", "", '<gazebo><sensor name="dvl" gz:type="dvl"/></gazebo>'),
    ],
)
def test_a_robot_of_the_field_is_read(tmp_path, encoding, declared, more):
    text = f"""<?xml version="1.0"{declared}?>
<!DOCTYPE robot>
<robot name="arm">{more}
  <link name="a"/><link name="b"/>
  <joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
</robot>"""
    path = tmp_path / "arm.urdf"
    path.write_bytes(text.encode(encoding))
    assert len(joints_of(load(path))) == 1


def test_an_srdf_and_a_urdf_of_a_wrong_encoding_are_named(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_bytes(b'<robot name="\xe9"/>')
    with pytest.raises(DescriptionError, match="line 1: byte 0xe9 is not utf-8 text"):
        load(path)
