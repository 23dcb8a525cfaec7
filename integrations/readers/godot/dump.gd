extends SceneTree
# Prints a world's graph, then the cell of each point of a file of `x y z` lines. It runs in Godot 3's server, the only
# one that package managers have; the check renames what Godot 4 calls otherwise in the reader.


func _init():
	var world = load("res://reader.gd").new()
	var result = world.load_file("res://world.glb")
	if result != OK:
		printerr("world.glb: error ", result)
		quit()
		return
	for i in range(world.cells.size()):
		_print("cell " + world.cells[i]["kind"], world.cells[i]["portals"])
		_print("sees", world.visible_from(i))
	for portal in world.portals:
		_print("portal " + portal["kind"], portal["cells"])
		for polygon in [portal["outline"]] + portal["pieces"]:
			var line = "polygon"
			for vertex in polygon:
				line += " %.9f %.9f %.9f" % [vertex.x, vertex.y, vertex.z]
			print(line)
	var points = File.new()
	points.open("res://points.txt", File.READ)
	while not points.eof_reached():
		var p = points.get_line().split_floats(" ")
		if p.size() == 3:
			print("at ", world.locate(Vector3(p[0], p[1], p[2])))
	quit()


func _print(what, ids):
	for id in ids:
		what += " " + str(int(id))
	print(what)
