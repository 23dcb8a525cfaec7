// Prints a world's graph, then the cell of each point of a file of `x y z` lines: dump WORLD POINTS
#include <cstdio>
#include <fstream>
#include <iostream>
#include <iterator>

#include "enfilade_world.hpp"

static void print(const std::vector<enfilade::Vertex>& polygon) {
    std::printf("polygon");
    for (const auto& vertex : polygon) std::printf(" %.9g %.9g %.9g", vertex[0], vertex[1], vertex[2]);
    std::printf("\n");
}

static void print(const char* what, const std::vector<int>& ids) {
    std::printf("%s", what);
    for (int id : ids) std::printf(" %d", id);
    std::printf("\n");
}

int main(int, char** args) try {
    std::ifstream file(args[1], std::ios::binary);
    enfilade::World world(std::vector<char>(std::istreambuf_iterator<char>(file), {}));
    for (size_t i = 0; i < world.cells.size(); i++) {
        print(("cell " + world.cells[i].kind).c_str(), world.cells[i].portals);
        print("sees", world.visible_from(i));
    }
    for (const auto& portal : world.portals) {
        print(("portal " + portal.kind).c_str(), {portal.cells.begin(), portal.cells.end()});
        print(portal.outline);
        for (const auto& piece : portal.pieces) print(piece);
    }
    std::ifstream points(args[2]);
    for (double x, y, z; points >> x >> y >> z;) std::printf("at %d\n", world.locate(x, y, z));
} catch (const std::exception& error) {
    std::cerr << args[1] << ": " << error.what() << "\n";
    return 1;
}
