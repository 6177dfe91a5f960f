"""check_scorm.py PACKAGE ADDRESS: whether a file is a package of SCORM 1.2 as its content aggregation model
(ADL 2001) and IMS content packaging 1.1.2 ask for it: names, order and number of the manifest's elements,
references, and that every file of the package is one of a resource. Says what is wrong."""
import sys
import xml.etree.ElementTree as tree
import zipfile

CP = "{http://www.imsproject.org/xsd/imscp_rootv1p1p2}"
ADL = "{http://www.adlnet.org/xsd/adlcp_rootv1p2}"
# Element: the elements that it holds, in their order.
HOLDS = {
    "manifest": ["metadata", "organizations", "resources"],
    "metadata": ["schema", "schemaversion"],
    "organizations": ["organization"],
    "organization": ["title", "item"],
    "item": ["title", ADL + "datafromlms"],
    "resources": ["resource"],
    "resource": ["file"],
}
MUST = {"manifest": ["identifier"], "organizations": ["default"], "organization": ["identifier"], "item": ["identifier", "identifierref"],
        "resource": ["identifier", "type", "href", ADL + "scormtype"], "file": ["href"]}
wrong = []


def check(good, sentence):
    if not good:
        wrong.append(sentence)


package, address = sys.argv[1:]
with zipfile.ZipFile(package) as packed:
    check(packed.testzip() is None, "a file of the package is damaged")
    names = packed.namelist()
    root = tree.fromstring(packed.read("imsmanifest.xml"))
    page = packed.read("index.html").decode()
for element in root.iter():
    name = element.tag.replace(CP, "")
    check([child.tag.replace(CP, "") for child in element] == HOLDS.get(name, []), f"{name} holds {[child.tag for child in element]}")
    for attribute in MUST.get(name, []):
        check(element.get(attribute), f"{name} has no {attribute}")
found = {name: root.findall(f".//{CP}{name}") for name in ("organization", "item", "resource", "file", "schema", "schemaversion")}
check([e.text for e in found["schema"] + found["schemaversion"]] == ["ADL SCORM", "1.2"], "it is of another schema")
check(root.find(f"{CP}organizations").get("default") == found["organization"][0].get("identifier"), "the default organization is not there")
check(found["item"][0].get("identifierref") == found["resource"][0].get("identifier"), "the item's resource is not there")
check(found["resource"][0].get("type") == "webcontent" and found["resource"][0].get(ADL + "scormtype") == "sco", "the resource is no SCO")
check(found["resource"][0].get("href") in [e.get("href") for e in found["file"]], "the resource does not list its page")
check(sorted(names) == sorted(["imsmanifest.xml"] + [e.get("href") for e in found["file"]]), f"the files are {names}")
launch = root.find(f".//{ADL}datafromlms").text
check(launch == address and len(launch) <= 255, f"launch data are {launch}, expected {address}")
check("<script" in page and "@SONDE" not in page, "the page is not built")
print("\n".join(wrong), end="")
sys.exit(bool(wrong))
