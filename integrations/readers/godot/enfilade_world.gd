class_name EnfiladeWorld
extends RefCounted
## A whole reader of baked worlds for Godot 4. Coordinates are those of the file and of Godot: meters, right-handed, +Y up.
##
##     var world = EnfiladeWorld.new()
##     if world.load_file("res://world.glb") == OK:
##         var cell = world.locate(camera.global_position)
##         for other in world.visible_from(cell): ...

## A Dictionary each, as in the file: "name", "portals", and "kind": "room", "outdoors" or "void".
var cells = []
## A Dictionary each, as in the file, but "outline" is an Array of Vector3, and "pieces" are Arrays of such.
var portals = []
var _bytes = StreamPeerBuffer.new()
var _gltf = {}
var _binary = 0
var _locator = {}
var _pvs = {}


## Returns OK, or an error: ERR_FILE_UNRECOGNIZED without a world, ERR_FILE_CORRUPT for one of an unknown version.
func load_file(path):
	_bytes.data_array = FileAccess.get_file_as_bytes(path)
	if _bytes.get_size() < 28 or _bytes.get_u32() != 0x46546C67:
		return ERR_FILE_UNRECOGNIZED
	_bytes.seek(12)
	_binary = 20 + _bytes.get_u32() + 8
	_bytes.seek(20)
	_gltf = JSON.parse_string(_bytes.get_utf8_string(_binary - 28))
	var world = _gltf.get("extensions", {}).get("ENFILADE_cell_portal_graph")
	if world == null:
		return ERR_FILE_UNRECOGNIZED
	if world["version"] > 2:
		return ERR_FILE_CORRUPT
	cells = world["cells"]
	for cell in cells:
		cell["kind"] = "outdoors" if cell.get("outdoor", false) else "void" if cell.get("void", false) else "room"
	portals = world["portals"]
	_bytes.seek(_start(world.get("portalCorners")))
	for portal in portals:
		portal["outline"] = _polygon(portal["outline"])
		for k in range(portal["pieces"].size()):
			portal["pieces"][k] = _polygon(portal["pieces"][k])
	_locator = world["locator"]
	_pvs = world.get("pvs", {})
	return OK


## Returns the cell of a point, or -1 in solid matter.
func locate(point):
	var box = _locator.get("bounds")
	for k in range(3):
		if box == null or point[k] < box[0][k] or point[k] > box[1][k]:
			return int(_locator.get("outside", -1))
	var planes = _start(_locator.get("planes"))
	var nodes = _start(_locator.get("nodes"))
	var at = int(_locator["root"])
	while at >= 0:
		_bytes.seek(nodes + 12 * at)
		var plane = _bytes.get_u32()
		_bytes.seek(planes + 32 * plane)
		var side = _bytes.get_double() * point.x + _bytes.get_double() * point.y + _bytes.get_double() * point.z
		side += _bytes.get_double()
		_bytes.seek(nodes + 12 * at + (8 if side < 0.0 else 4))
		at = _bytes.get_32()
	return -2 - at


## Returns the cells that may be visible from a cell: all of them in a world without a potentially visible set.
func visible_from(cell):
	if not _pvs.has("rows"):
		return range(cells.size())
	var out = []
	_bytes.seek(_start(_pvs["rows"]) + 4 * max(cell - 1, 0))
	var run = _bytes.get_u32() if cell > 0 else 0
	var end = _bytes.get_u32()
	_bytes.seek(_start(_pvs["runs"]) + 8 * run)
	while run < end:
		var first = _bytes.get_u32()
		out += range(first, _bytes.get_u32())
		run += 1
	return out


func _start(view):
	return _binary + int(_gltf["bufferViews"][view].get("byteOffset", 0)) if view != null else 0


func _polygon(n):
	var out = []
	for _i in range(n):
		out.append(Vector3(_bytes.get_float(), _bytes.get_float(), _bytes.get_float()))
	return out
