#include "abbe/calib/joint/contribution.hpp"

#include <cmath>
#include <utility>

#include "abbe/calib/otf/judge/lack_of_fit.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::joint {
namespace {

/// rms standard uncertainty of V of the joint model; nullopt if the parts leave a combination
/// undetermined.
Result<std::optional<double>> u_of(std::span<const Part> parts, const CommonTables& common) {
  const Result<JointModel> joint = joint_model(parts, common);
  if (joint) {
    return otf::correction_size(joint->model).u_m;
  }
  if (joint.error().code == ErrorCode::RankDeficient) {
    return std::nullopt;
  }
  return tl::unexpected(joint.error());
}

}  // namespace

Result<std::vector<Contribution>> contributions(std::span<const Part> parts,
                                                const CommonTables& common) {
  std::vector<Contribution> all;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    std::vector<Part> others(parts.begin(), parts.end());
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
    const Result<std::optional<double>> alone = u_of(parts.subspan(k, 1), common);
    ABBE_TRY(alone);
    all.push_back({.u_alone_m = *alone, .u_without_m = {}});
    if (others.empty()) {
      continue;
    }
    const Result<std::optional<double>> without = u_of(others, common);
    ABBE_TRY(without);
    all.back().u_without_m = *without;
  }
  return all;
}

std::vector<TableUncertainty> table_uncertainties(const VolumetricModel& model) {
  std::vector<TableUncertainty> tables;
  std::size_t nodes = 0;
  double squares = 0.0;
  for (const Parameter& p : model.parameters()) {
    if (tables.empty() || tables.back().table != p.name) {
      tables.push_back({p.name, p.is_angle(), 0.0});
      nodes = 0;
      squares = 0.0;
    }
    squares += p.u * p.u;
    tables.back().u = std::sqrt(squares / static_cast<double>(++nodes));
  }
  return tables;
}

}  // namespace abbe::calib::joint
