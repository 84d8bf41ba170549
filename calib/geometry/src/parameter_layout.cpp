#include "abbe/calib/geometry/parameter_layout.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib {
namespace {

constexpr std::array<std::string_view, 6> kRigidNames{"tx", "ty", "tz", "rx", "ry", "rz"};

Result<void> check(const MachineNodes& nodes) {
  for (const Axis a : kAllAxes) {
    const AxisNodes& axis = nodes[index(a)];
    if (Result<void> valid = check_nodes(axis.nodes_m); !valid) {
      return failure(valid.error().code, message("axis ", letter(a), ": ", valid.error().text));
    }
    if (!(axis.reference_m >= axis.nodes_m.front() && axis.reference_m <= axis.nodes_m.back())) {
      return failure(ErrorCode::BadInput,
                     message("axis ", letter(a), ": reference ", axis.reference_m, " m is outside ",
                             axis.nodes_m.front(), " to ", axis.nodes_m.back(), " m"));
    }
  }
  return {};
}

/// True if e is a rotation whose effect, with a constant target offset, is the same as that of
/// translations, so that data cannot separate them.
bool inseparable_from_translation(const KinematicChain& chain, ErrorMotion e) {
  if (!is_rotation(e.motion)) {
    return false;
  }
  const Axis last = chain.order_w_to_t()[2];
  return e.axis == last || (chain.place(e.axis) == 1 && direction(e.motion) == index(last));
}

template <class Predicate>
std::vector<ErrorMotion> motions(Predicate keep) {
  std::vector<ErrorMotion> kept;
  for (const Axis axis : kAllAxes) {
    for (const Motion motion : kAllMotions) {
      if (const ErrorMotion e{motion, axis}; keep(e)) {
        kept.push_back(e);
      }
    }
  }
  return kept;
}

}  // namespace

Result<ParameterLayout> ParameterLayout::observable_with_one_target(const KinematicChain& chain,
                                                                    MachineNodes nodes) {
  return with_tables(chain, std::move(nodes), motions([&](ErrorMotion e) {
                       return !inseparable_from_translation(chain, e);
                     }));
}

Result<ParameterLayout> ParameterLayout::all_tables(const KinematicChain& chain,
                                                    MachineNodes nodes) {
  return with_tables(chain, std::move(nodes), motions([](ErrorMotion) { return true; }));
}

Result<ParameterLayout> ParameterLayout::with_tables(const KinematicChain& chain,
                                                     MachineNodes nodes,
                                                     std::span<const ErrorMotion> wanted) {
  ABBE_TRY(check(nodes));

  ParameterLayout layout;
  layout.chain_ = chain;
  layout.nodes_ = std::move(nodes);
  layout.squareness_from_m_ = reference_position_m(layout.nodes_);

  const auto is_wanted = [&](ErrorMotion e) {
    return std::find(wanted.begin(), wanted.end(), e) != wanted.end();
  };

  for (const ErrorMotion e : motions(is_wanted)) {
    layout.tables_.push_back({e, layout.squareness_offset_});
    layout.squareness_offset_ += layout.node_count(e.axis);
  }

  if (layout.tables_.size() != wanted.size()) {
    return failure(ErrorCode::BadInput, message("error tables: ", wanted.size(), " requested, ",
                                                layout.tables_.size(), " of them distinct"));
  }

  return layout;
}

ParameterLayout ParameterLayout::with_squareness_from(const Vector3& axis_position_m) const {
  ParameterLayout layout = *this;
  layout.squareness_from_m_ = axis_position_m;
  return layout;
}

std::optional<Table> ParameterLayout::find(ErrorMotion e) const {
  for (const Table& table : tables_) {
    if (table.motion == e) {
      return table;
    }
  }
  return std::nullopt;
}

std::string ParameterLayout::label(std::size_t parameter) const {
  if (parameter >= rigid_offset()) {
    return std::string(kRigidNames.at(parameter - rigid_offset()));
  }

  if (parameter >= squareness_offset_) {
    return std::string(kSquarenessNames.at(parameter - squareness_offset_));
  }

  std::size_t i = tables_.size() - 1;
  while (tables_[i].offset > parameter) {
    --i;
  }

  const std::vector<double>& nodes = nodes_[index(tables_[i].motion.axis)].nodes_m;
  char position[32];
  std::snprintf(position, sizeof position, "%+.3f", nodes[parameter - tables_[i].offset]);

  return message(name(tables_[i].motion), " at ", position, " m");
}

}  // namespace abbe::calib
