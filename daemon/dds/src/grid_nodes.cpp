#include "abbe/dds/grid_nodes.hpp"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <string>
#include <vector>

namespace abbe::dds {
namespace {

using daemon::ErrorCode;
using daemon::Result;

constexpr double kMillimetre = 1e-3;
constexpr double kMicrometre = 1e-6;

Eigen::Vector3d vector_of(const std::array<double, 3>& a) {
  return {a[0], a[1], a[2]};
}

}  // namespace

Result<daemon::ErrorLattice> lattice_of(std::span<const v1::GridNode> nodes) {
  std::vector<daemon::LatticeNode> lattice;
  for (const v1::GridNode& node : nodes) {
    lattice.push_back({vector_of(node.position_m()), vector_of(node.error_m()), node.inside()});
  }
  auto created = daemon::ErrorLattice::create(lattice);
  if (!created) return daemon::fail(created.error().code, "received grid: " + created.error().text);
  return std::move(*created);
}

Result<void> write_grid_csv(const std::filesystem::path& file,
                            std::span<const v1::GridNode> nodes) {
  std::string text = "x_mm,y_mm,z_mm,ex_um,ey_um,ez_um,ux_um,uy_um,uz_um\n";
  for (const v1::GridNode& node : nodes) {
    const auto& p = node.position_m();
    const auto& e = node.error_m();
    const auto& cov = node.cov_m2();  // xx xy xz yy yz zz
    text +=
        fmt::format("{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g}\n",
                    p[0] / kMillimetre, p[1] / kMillimetre, p[2] / kMillimetre, e[0] / kMicrometre,
                    e[1] / kMicrometre, e[2] / kMicrometre, std::sqrt(cov[0]) / kMicrometre,
                    std::sqrt(cov[3]) / kMicrometre, std::sqrt(cov[5]) / kMicrometre);
  }

  std::ofstream out(file, std::ios::trunc);
  if (!(out << text).flush())
    return daemon::fail(ErrorCode::Io, file.string() + ": cannot be written");

  return {};
}

}  // namespace abbe::dds
