#include "abbe/sim/mfb/plan.hpp"

#include <algorithm>
#include <array>

namespace abbe::sim::mfb {
namespace {

using Eigen::Vector3d;

constexpr double kReferenceLength_m = 0.55;
constexpr double kReach_m = 0.1;    // lateral reach of a star stylus
constexpr double kStylus_m = 0.15;  // distance from the tool reference point down to the tip

const Vector3d kX = Vector3d::UnitX(), kY = Vector3d::UnitY(), kZ = Vector3d::UnitZ();

/// The tool offset of a tip that is beside the spindle axis, in the direction `lateral`.
Vector3d tool(const Vector3d& lateral) {
  return kReach_m * lateral - kStylus_m * kZ;
}

Measurement lying(std::string name, std::string position, const Vector3d& origin_mm,
                  const Vector3d& bar_x, const Vector3d& bar_z, const Vector3d& lateral) {
  return {.name = std::move(name),
          .position = std::move(position),
          .origin_m = 1e-3 * origin_mm,
          .bar_x = bar_x.normalized(),
          .bar_z = bar_z,
          .tool_offset_m = tool(lateral)};
}

/// A bar of the reference length with its middle at `centre_mm`.
Measurement diagonal(std::string name, std::string position, const Vector3d& centre_mm,
                     const Vector3d& bar_x, const Vector3d& bar_z, const Vector3d& lateral) {
  const Vector3d half_mm = 500.0 * kReferenceLength_m * bar_x.normalized();
  return lying(std::move(name), std::move(position), centre_mm - half_mm, bar_x, bar_z, lateral);
}

/// Measurements parallel to X and Y. The lateral reach is -J of [Viprey 2016] Eq. 8.
std::vector<Measurement> horizontal(bool rolled) {
  const Vector3d none = Vector3d::Zero();
  std::vector<Measurement> plan{lying("X1", "P1", {0, 100, 0}, kX, kZ, none),
                                lying("X2", "P2", {0, 100, 350}, kX, kZ, none)};
  plan.push_back(rolled ? lying("X3", "P3", {0, 450, 0}, kX, kY, -kY)
                        : lying("X3", "P3", {0, 450, 0}, kX, kZ, none));
  plan.push_back(lying("Y1", "P4", {275, 0, 0}, kY, kZ, none));
  plan.push_back(lying("Y2", "P5", {275, 0, 350}, kY, kZ, none));
  plan.push_back(lying("Y3+", "P6", {275, 0, 100}, kY, kX, -kX));
  plan.push_back(lying("Y3-", "P6", {275, 0, 100}, kY, kX, kX));
  return plan;
}

std::vector<Measurement> vertical_and_diagonal() {
  const Vector3d foot_mm(275, 275, -150), middle_mm(275, 275, 125);
  const Vector3d none = Vector3d::Zero();
  return {lying("Z1+", "P7", foot_mm, kZ, kX, -kX),
          lying("Z1-", "P7", foot_mm, kZ, kX, kX),
          lying("Z2+", "P8", foot_mm, kZ, kY, -kY),
          lying("Z2-", "P8", foot_mm, kZ, kY, kY),
          diagonal("DXY1", "P9", {275, 275, 0}, kX + kY, kZ, none),
          diagonal("DXY2", "P10", {275, 275, 0}, kX - kY, kZ, none),
          diagonal("DXZ1", "P11", middle_mm, kX + kZ, kY, -kY),
          diagonal("DXZ2", "P12", middle_mm, kX - kZ, kY, -kY),
          diagonal("DYZ1", "P13", middle_mm, kY + kZ, kX, -kX),
          diagonal("DYZ2", "P14", middle_mm, kY - kZ, kX, -kX)};
}

bool in_fewest(const Measurement& m) {
  constexpr std::array kLeftOut{"Y3-", "Z2-", "DXY2", "DXZ2", "DYZ2"};
  return std::none_of(kLeftOut.begin(), kLeftOut.end(),
                      [&](const char* name) { return m.name == name; });
}

}  // namespace

std::vector<Measurement> reference_plan(PlanKind kind, Passes passes, double bar_length_m) {
  std::vector<Measurement> plan = horizontal(kind == PlanKind::FullRolled);
  const auto others = vertical_and_diagonal();
  plan.insert(plan.end(), others.begin(), others.end());
  if (kind == PlanKind::Fewest) std::erase_if(plan, [](const auto& m) { return !in_fewest(m); });

  std::vector<Measurement> all;
  for (Measurement& m : plan) {
    m.origin_m *= bar_length_m / kReferenceLength_m;
    all.push_back(m);
    if (passes == Passes::ForwardAlone) continue;
    m.name += " back";
    m.pass = Pass::Backward;
    all.push_back(std::move(m));
  }
  return all;
}

}  // namespace abbe::sim::mfb
