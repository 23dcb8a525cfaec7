// A whole reader of baked worlds for C++17 programs; it needs nlohmann/json. Coordinates are those of the file: meters,
// right-handed, +Y up. It copies from little-endian files, so the machine must be little-endian, too.
#pragma once
#include <array>
#include <cstdint>
#include <cstring>
#include <numeric>
#include <stdexcept>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace enfilade {
using Vertex = std::array<float, 3>;
struct Cell { std::string name, kind; std::vector<int> portals; };
struct Portal { std::array<int, 2> cells; std::string kind; std::vector<Vertex> outline; std::vector<std::vector<Vertex>> pieces; };

class World {
public:
    std::vector<Cell> cells;
    std::vector<Portal> portals;

    explicit World(std::vector<char> bytes) : glb(std::move(bytes)) {
        if (glb.size() < 28 || get<uint32_t>(0) != 0x46546C67) throw std::runtime_error("this is not a .glb file");
        binary = 20 + size_t(get<uint32_t>(12)) + 8;
        gltf = nlohmann::json::parse(glb.begin() + 20, glb.begin() + ptrdiff_t(std::min(binary - 8, glb.size())));
        if (!gltf.contains("/extensions/ENFILADE_cell_portal_graph"_json_pointer)) throw std::runtime_error("this is not a world: bake it first");
        const auto& world = gltf["extensions"]["ENFILADE_cell_portal_graph"];
        if (world["version"] > 2) throw std::runtime_error("the world is of an unknown version");
        for (const auto& c : world["cells"])
            cells.push_back({c["name"], c.value("outdoor", false) ? "outdoors" : c.value("void", false) ? "void" : "room", c["portals"]});
        size_t at = start(world, "portalCorners");
        auto polygon = [&](size_t n) {
            std::vector<Vertex> out;
            for (; n > 0; n--, at += 12) out.push_back(get<Vertex>(at));
            return out;
        };
        for (const auto& p : world["portals"]) {
            portals.push_back({p["cells"], p["kind"], polygon(p["outline"]), {}});
            for (size_t n : p["pieces"]) portals.back().pieces.push_back(polygon(n));
        }
        locator = world["locator"];
        planes = start(locator, "planes"), nodes = start(locator, "nodes");
        if (world.contains("pvs")) rows = start(world["pvs"], "rows"), runs = start(world["pvs"], "runs");
    }

    /// Returns the cell of a point, or -1 in solid matter.
    int locate(double x, double y, double z) const {
        const double p[] = {x, y, z};
        bool inside = locator.contains("bounds");
        for (size_t k = 0; inside && k < 3; k++) inside = locator["bounds"][0][k] <= p[k] && p[k] <= locator["bounds"][1][k];
        if (!inside) return locator.value("outside", -1);
        int at = locator["root"];
        while (at >= 0) {
            const auto plane = get<std::array<double, 4>>(planes + 32 * get<uint32_t>(nodes + 12 * size_t(at)));
            at = get<int32_t>(nodes + 12 * size_t(at) + (plane[0] * x + plane[1] * y + plane[2] * z + plane[3] < 0 ? 8 : 4));
        }
        return -2 - at;
    }

    /// Returns the cells that may be visible from a cell: all of them in a world without a potentially visible set.
    std::vector<int> visible_from(size_t cell) const {
        std::vector<int> out(rows ? 0 : cells.size());
        std::iota(out.begin(), out.end(), 0);
        if (!rows) return out;
        for (uint32_t run = cell ? get<uint32_t>(rows + 4 * cell - 4) : 0; run < get<uint32_t>(rows + 4 * cell); run++)
            for (auto c = get<uint32_t>(runs + 8 * run); c < get<uint32_t>(runs + 8 * run + 4); c++) out.push_back(int(c));
        return out;
    }

private:
    std::vector<char> glb;
    nlohmann::json gltf, locator;
    size_t binary = 0, planes = 0, nodes = 0, rows = 0, runs = 0;

    template <class T> T get(size_t at) const {
        T out;
        if (at + sizeof(T) > glb.size()) throw std::runtime_error("the file ends early");
        std::memcpy(&out, glb.data() + at, sizeof(T));
        return out;
    }
    size_t start(const nlohmann::json& of, const char* view) const {
        return of.contains(view) ? binary + gltf["bufferViews"][of[view].get<size_t>()].value("byteOffset", size_t(0)) : 0;
    }
};
}  // namespace enfilade
