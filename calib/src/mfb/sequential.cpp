#include "mfb/sequential.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "message.hpp"
#include "mfb/joint.hpp"
#include "mfb/residuals.hpp"
#include "mfb/sequential_roles.hpp"

namespace abbe::calib::mfb {
namespace {

/// Values at the holes of a profile, one row per hole. The first column is that of the
/// observations, the others their derivatives by each coordinate of each profile: every step of the
/// sequence is linear, so that the covariance of the result follows from the last columns.
using HoleRows = Eigen::MatrixXd;

class Sequence {
 public:
  Sequence(const Observations& o, std::vector<Profile> profiles, SequentialRoles roles)
      : o_(o), profiles_(std::move(profiles)), roles_(std::move(roles)) {
    const Eigen::Index holes = std::ssize(o.bar.O_m), rows = 3 * holes;
    const Eigen::Index columns = 1 + rows * std::ssize(profiles_);
    U_ = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(o.basis.size()), columns);
    for (std::size_t m = 0; m < profiles_.size(); ++m) {
      delta_.push_back(in_machine_axes(m, 1 + rows * static_cast<Eigen::Index>(m), columns));
    }
  }

  Result<void> run() {
    return x_stage()
        .and_then([&] { return y_stage(); })
        .and_then([&] { return z_stage(); })
        .and_then([&] { return squareness_stage(); });
  }
  [[nodiscard]] const Eigen::MatrixXd& U() const { return U_; }
  [[nodiscard]] const std::vector<Profile>& profiles() const { return profiles_; }

 private:
  using Delta = std::array<HoleRows, 3>;  ///< x, y, z of the machine

  /// Mean of the passes; derivatives by the mean deviations in bar axes.
  [[nodiscard]] Delta in_machine_axes(std::size_t m, Eigen::Index first,
                                      Eigen::Index columns) const {
    const Profile& p = profiles_[m];
    Delta d;
    d.fill(HoleRows::Zero(std::ssize(p.hole), columns));
    for (std::size_t row = 0; row < p.hole.size(); ++row) {
      const auto r = static_cast<Eigen::Index>(row);
      const auto at = 3 * static_cast<Eigen::Index>(p.hole[row]);
      Vector3 mean_m = Vector3::Zero();
      for (const std::size_t pass : p.passes) {
        mean_m += o_.passes[pass].delta_m.segment<3>(at) / static_cast<double>(p.passes.size());
      }
      const Vector3 machine_m = p.axes * mean_m;
      for (Eigen::Index c = 0; c < 3; ++c) {
        d[static_cast<std::size_t>(c)](r, 0) = machine_m(c);
        d[static_cast<std::size_t>(c)].block<1, 3>(r, first + at) = p.axes.row(c);
      }
    }
    return d;
  }

  /// The deviations without the effect of the errors found so far: delta = -V.
  [[nodiscard]] Delta without_known(std::size_t m) const {
    const Profile& p = profiles_[m];
    Delta d = delta_[m];
    std::vector<estimation::Column> memory(o_.basis.most_columns());
    for (std::size_t row = 0; row < p.hole.size(); ++row) {
      estimation::ModelColumns columns(memory);
      o_.basis.append_columns({.q_m = p.on_axis_m[row] - p.tool_m, .tool_offset_m = p.tool_m},
                              columns);
      for (const estimation::Column& c : columns.span()) {
        const auto parameter = static_cast<Eigen::Index>(c.parameter);
        for (Eigen::Index k = 0; k < 3; ++k) {
          if (c.dV_dU(k) != 0.0 && known_[c.parameter]) {
            d[static_cast<std::size_t>(k)].row(static_cast<Eigen::Index>(row)) +=
                c.dV_dU(k) * U_.row(parameter);
          }
        }
      }
    }
    return d;
  }

  /// The same minus the first row.
  [[nodiscard]] Delta from_first(std::size_t m) const {
    Delta d = without_known(m);
    for (HoleRows& rows : d) {
      rows.rowwise() -= rows.row(0).eval();
    }
    return d;
  }

  [[nodiscard]] Eigen::VectorXd tip(std::size_t m, Eigen::Index axis) const {
    Eigen::VectorXd values(std::ssize(profiles_[m].on_axis_m));
    for (std::size_t i = 0; i < profiles_[m].on_axis_m.size(); ++i) {
      values(static_cast<Eigen::Index>(i)) = profiles_[m].on_axis_m[i](axis);
    }
    return values;
  }
  /// J of the paper.
  [[nodiscard]] Vector3 J(std::size_t m) const { return -profiles_[m].tool_m; }

  /// (D of the second - D of the first) / difference, in one direction.
  [[nodiscard]] HoleRows slope(const ProfilePair& pair, std::size_t direction) const {
    return (from_first(pair.second)[direction] - from_first(pair.first)[direction]) /
           pair.difference_m;
  }

  /// Minus the line through the first and the last value.
  [[nodiscard]] HoleRows detrended(HoleRows rows, std::size_t m, Eigen::Index axis) const {
    const Eigen::VectorXd x = tip(m, axis);
    const Eigen::Index last = x.size() - 1;
    const Eigen::VectorXd t = (x.array() - x(0)) / (x(last) - x(0));
    const Eigen::RowVectorXd first = rows.row(0), rise = rows.row(last) - first;
    rows.rowwise() -= first;
    rows -= t * rise;
    rows.row(last).setZero();  // without rounding
    return rows;
  }

  /// Mean of `value` over all profiles along an axis.
  template <class Value>
  [[nodiscard]] HoleRows mean_along(std::size_t axis, const Value& value) const {
    HoleRows sum = HoleRows::Zero(std::ssize(o_.bar.O_m), U_.cols());
    for (const std::size_t m : roles_.along[axis]) {
      sum += value(m, from_first(m)) / static_cast<double>(roles_.along[axis].size());
    }
    return sum;
  }

  /// Sets a table from its values at the holes of profile m, in gauge G1.
  Result<void> set(ErrorMotion motion, const HoleRows& values, std::size_t m);
  Result<void> x_stage();
  Result<void> y_stage();
  Result<void> z_stage();
  Result<void> squareness_stage();
  /// Slope of the deviation along the bar against the place along the bar.
  [[nodiscard]] Eigen::RowVectorXd slope_along_bar(std::size_t m) const;

  const Observations& o_;
  std::vector<Profile> profiles_;
  SequentialRoles roles_;
  std::vector<Delta> delta_;
  Eigen::MatrixXd U_;
  std::vector<bool> known_ = std::vector<bool>(o_.basis.size(), false);
};

Result<void> Sequence::set(ErrorMotion motion, const HoleRows& values, std::size_t m) {
  const Profile& p = profiles_[m];
  const auto axis = static_cast<Eigen::Index>(index(motion.axis));
  const std::vector<double>& nodes_m = o_.basis.layout().nodes()[index(motion.axis)].nodes_m;
  std::vector<double> readings_m;
  for (const Vector3& tip_m : p.on_axis_m) {
    readings_m.push_back(tip_m(axis) - p.tool_m(axis));
  }
  const double half_m = 0.5 * (nodes_m[1] - nodes_m[0]);
  if (nodes_m.front() < readings_m.front() - half_m ||
      nodes_m.back() > readings_m.back() + half_m) {
    return failure(
        ErrorCode::NotApplicable,
        message("sequential estimator: the bar does not cover the nodes of ", letter(motion.axis)));
  }

  const auto holes =
      estimation::AxisInterpolation::of(readings_m, estimation::Interpolation::NotAKnotCubic);
  if (!holes) {
    return tl::unexpected(holes.error());
  }
  const auto at = [&](double position_m) {
    const estimation::NodeWeights w = holes->at(position_m);
    Eigen::RowVectorXd value = Eigen::RowVectorXd::Zero(values.cols());
    for (std::size_t i = 0; i < w.count(); ++i) {
      value += w[i] * values.row(static_cast<Eigen::Index>(w.first() + i));
    }
    return value;
  };

  const auto table = o_.basis.layout().find(motion);
  const auto first = static_cast<Eigen::Index>(table->offset);
  const auto count = std::ssize(nodes_m);
  for (Eigen::Index k = 0; k < count; ++k) {
    U_.row(first + k) = at(nodes_m[static_cast<std::size_t>(k)]);
    known_[static_cast<std::size_t>(first + k)] = true;
  }

  auto rows = U_.middleRows(first, count);
  if (is_straightness(motion)) {
    const Eigen::RowVectorXd begin = rows.row(0), rise = rows.row(count - 1) - begin;
    const Eigen::Map<const Eigen::VectorXd> x(nodes_m.data(), count);
    rows.rowwise() -= begin;
    rows -= ((x.array() - x(0)) / (x(count - 1) - x(0))).matrix() * rise;
    rows.row(count - 1).setZero();  // without rounding
  } else {
    const double reference_m = o_.basis.layout().nodes()[index(motion.axis)].reference_m;
    const auto w = o_.basis.interpolation(motion.axis).at(reference_m);
    Eigen::RowVectorXd value = Eigen::RowVectorXd::Zero(rows.cols());
    for (std::size_t i = 0; i < w.count(); ++i) {
      value += w[i] * rows.row(static_cast<Eigen::Index>(w.first() + i));
    }
    rows.rowwise() -= value;
  }
  return {};
}

Result<void> Sequence::x_stage() {
  constexpr std::size_t x = 0, y = 1, z = 2;
  const ProfilePair &dG = roles_.x_at_two_z, &dF = roles_.x_at_two_y;
  const HoleRows EBX = -slope(dG, x), ECX = slope(dF, x);
  const HoleRows EAX = detrended(0.5 * (slope(dG, y) - slope(dF, z)), dG.first, 0);
  const HoleRows EXX = mean_along(0, [&](std::size_t m, const Delta& D) -> HoleRows {
    return -D[x] - tip(m, 2).asDiagonal() * EBX + tip(m, 1).asDiagonal() * ECX;
  });
  const HoleRows EYX = mean_along(0, [&](std::size_t m, const Delta& D) -> HoleRows {
    return -D[y] + tip(m, 2).asDiagonal() * EAX + J(m).x() * ECX;
  });
  const HoleRows EZX = mean_along(0, [&](std::size_t m, const Delta& D) -> HoleRows {
    return -D[z] - tip(m, 1).asDiagonal() * EAX - J(m).x() * EBX;
  });

  const std::size_t m = dG.first;
  return set({Motion::X, Axis::X}, EXX, m)
      .and_then([&] {
        return set({Motion::Y, Axis::X}, detrended(EYX, m, 0), m);
      })
      .and_then([&] {
        return set({Motion::Z, Axis::X}, detrended(EZX, m, 0), m);
      })
      .and_then([&] {
        return set({Motion::A, Axis::X}, EAX, m);
      })
      .and_then([&] {
        return set({Motion::B, Axis::X}, EBX, m);
      })
      .and_then([&] {
        return set({Motion::C, Axis::X}, ECX, m);
      });
}

Result<void> Sequence::y_stage() {
  constexpr std::size_t x = 0, y = 1, z = 2;
  const ProfilePair &dG = roles_.y_at_two_z, &dJ = roles_.y_with_two_tools_x;
  const HoleRows EAY = slope(dG, y), ECY = slope(dJ, y), EBY = -slope(dJ, z);
  const HoleRows EXY = mean_along(1, [&](std::size_t m, const Delta& D) -> HoleRows {
    return -D[x] - tip(m, 2).asDiagonal() * EBY - J(m).y() * ECY;
  });
  const HoleRows EYY = mean_along(1, [&](std::size_t m, const Delta& D) -> HoleRows {
    return -D[y] + tip(m, 2).asDiagonal() * EAY + J(m).x() * ECY;
  });
  const HoleRows EZY = mean_along(1, [&](std::size_t m, const Delta& D) -> HoleRows {
    return -D[z] + J(m).y() * EAY - J(m).x() * EBY;
  });

  const std::size_t m = dG.first;
  return set({Motion::X, Axis::Y}, detrended(EXY, m, 1), m)
      .and_then([&] {
        return set({Motion::Y, Axis::Y}, EYY, m);
      })
      .and_then([&] {
        return set({Motion::Z, Axis::Y}, detrended(EZY, m, 1), m);
      })
      .and_then([&] {
        return set({Motion::A, Axis::Y}, EAY, m);
      })
      .and_then([&] {
        return set({Motion::B, Axis::Y}, EBY, m);
      })
      .and_then([&] {
        return set({Motion::C, Axis::Y}, ECY, m);
      });
}

Result<void> Sequence::z_stage() {
  constexpr std::size_t x = 0, y = 1, z = 2;
  const ProfilePair &dJx = roles_.z_with_two_tools_x, &dJy = roles_.z_with_two_tools_y;
  const HoleRows EBZ = -slope(dJx, z), EAZ = slope(dJy, z);
  const HoleRows ECZ = 0.5 * (slope(dJx, y) - slope(dJy, x));
  const HoleRows EXZ = mean_along(2, [&](std::size_t m, const Delta& D) -> HoleRows {
    return -D[x] + J(m).z() * EBZ - J(m).y() * ECZ;
  });
  const HoleRows EYZ = mean_along(2, [&](std::size_t m, const Delta& D) -> HoleRows {
    return -D[y] - J(m).z() * EAZ + J(m).x() * ECZ;
  });
  const HoleRows EZZ = mean_along(2, [&](std::size_t m, const Delta& D) -> HoleRows {
    return -D[z] + J(m).y() * EAZ - J(m).x() * EBZ;
  });

  const std::size_t m = dJx.first;
  return set({Motion::X, Axis::Z}, detrended(EXZ, m, 2), m)
      .and_then([&] {
        return set({Motion::Y, Axis::Z}, detrended(EYZ, m, 2), m);
      })
      .and_then([&] {
        return set({Motion::Z, Axis::Z}, EZZ, m);
      })
      .and_then([&] {
        return set({Motion::A, Axis::Z}, EAZ, m);
      })
      .and_then([&] {
        return set({Motion::B, Axis::Z}, EBZ, m);
      })
      .and_then([&] {
        return set({Motion::C, Axis::Z}, ECZ, m);
      });
}

Eigen::RowVectorXd Sequence::slope_along_bar(std::size_t m) const {
  const Profile& p = profiles_[m];
  const Delta d = without_known(m);
  const Vector3 along = (p.tip_m.back() - p.tip_m.front()).normalized();
  Eigen::VectorXd s(std::ssize(p.tip_m));
  for (std::size_t i = 0; i < p.tip_m.size(); ++i) {
    s(static_cast<Eigen::Index>(i)) = along.dot(p.tip_m[i]);
  }
  s.array() -= s.mean();
  return s.transpose() * (along.x() * d[0] + along.y() * d[1] + along.z() * d[2]) / s.squaredNorm();
}

Result<void> Sequence::squareness_stage() {
  const auto difference = [&](const std::array<std::size_t, 2>& pair) {
    return Eigen::RowVectorXd(slope_along_bar(pair[0]) - slope_along_bar(pair[1]));
  };
  const auto EA0Z = static_cast<Eigen::Index>(o_.basis.layout().squareness_offset());
  U_.row(EA0Z) = difference(roles_.diagonals[2]);
  U_.row(EA0Z + 1) = -difference(roles_.diagonals[1]);
  U_.row(EA0Z + 2) = difference(roles_.diagonals[0]);
  return {};
}

Result<Sequence> finished_sequence(const Observations& o) {
  if (o.basis.layout().chain().order_w_to_t() != kAllAxes) {
    return failure(ErrorCode::NotApplicable,
                   message("sequential estimator: the chain ", o.basis.layout().chain().text(),
                           " has another order than X, Y, Z from workpiece to tool"));
  }
  std::vector<Profile> profiles = profiles_of(o);
  return roles_of(profiles).and_then([&](SequentialRoles roles) -> Result<Sequence> {
    Sequence sequence(o, std::move(profiles), std::move(roles));
    if (Result<void> done = sequence.run(); !done) {
      return tl::unexpected(done.error());
    }
    return sequence;
  });
}

/// Effects on U of independent errors with unit variance, one column each.
Eigen::MatrixXd root_of_result(const Observations& o, const Sequence& sequence,
                               const SharedUnknowns& shared) {
  const Eigen::Index rows = 3 * std::ssize(o.bar.O_m);
  RootsOfNoise roots(o.plan.noise);
  const Eigen::Index n = sequence.U().rows(), bar = shared.bar_root().cols();
  const Eigen::Index positions = std::ssize(o.positions);
  Eigen::MatrixXd of_noise(n, rows * std::ssize(sequence.profiles()));
  Eigen::MatrixXd of_others = Eigen::MatrixXd::Zero(n, bar + 1 + positions);

  for (std::size_t m = 0; m < sequence.profiles().size(); ++m) {
    const Profile& p = sequence.profiles()[m];
    const PassObservation& pass = o.passes[p.passes.front()];
    const Eigen::Index first = rows * static_cast<Eigen::Index>(m);
    const Eigen::MatrixXd S = sequence.U().middleCols(1 + first, rows);
    of_noise.middleCols(first, rows) = S * Eigen::MatrixXd((*roots.of(pass))->matrixL()) /
                                       std::sqrt(static_cast<double>(p.passes.size()));

    of_others.leftCols(bar) += S * shared.bar_root();
    const Eigen::Map<const Eigen::VectorXd> O(o.bar.O_m.front().data(), rows);
    const double alpha_per_K = o.bar.expansion ? o.bar.expansion->alpha_per_K : 0.0;
    of_others.col(bar) +=
        (pass.temperature_K - kReferenceTemperature_K) * shared.u_alpha_per_K() * (S * O);
    of_others.col(bar + 1 + static_cast<Eigen::Index>(pass.position)) +=
        alpha_per_K * o.plan.noise.u_temperature_K * (S * O);
  }

  Eigen::MatrixXd all(n, of_noise.cols() + of_others.cols());
  all << of_noise, of_others;
  return all;
}

/// Residuals and poses for the tables found: every position gets its best pose.
Result<void> set_residuals_of_sequence(Solution& solution, const Observations& o,
                                       const SolveOptions& options) {
  const Result<JointSystem> system = joint_system(o, nuisance_options(options));
  if (!system) {
    return tl::unexpected(system.error());
  }
  SharedEstimate estimate;
  estimate.x = Eigen::VectorXd::Zero(system->shared.size());
  estimate.x.head(system->shared.parameters()) = system->shared.free_of(solution.U);
  estimate.covariance = Eigen::MatrixXd::Zero(estimate.x.size(), estimate.x.size());
  set_residuals(solution, o, *system, estimate);

  Statistics& s = solution.statistics;
  s.unknowns = static_cast<std::size_t>(system->shared.parameters());
  for (const PositionSystem& position : system->positions) {
    s.observations += static_cast<std::size_t>(position.y.size());
    s.unknowns += static_cast<std::size_t>(position.layout.size);
  }
  s.rank = s.unknowns;
  s.condition = estimate_of(*system).condition;
  s.degrees_of_freedom = static_cast<double>(s.observations) - static_cast<double>(s.unknowns);
  for (PassResiduals& pass : solution.residuals) {
    s.chi2 += pass.chi2;
    pass.degrees_of_freedom = s.degrees_of_freedom / static_cast<double>(o.passes.size());
  }
  s.chi2_per_dof = s.chi2 / s.degrees_of_freedom;
  s.sigma0 = std::sqrt(s.chi2_per_dof);
  s.chi2_per_dof_limit = chi2_per_dof_quantile(s.degrees_of_freedom);
  return {};
}

}  // namespace

Result<Solution> solve_sequential(const Observations& o, const SolveOptions& options) {
  return finished_sequence(o).and_then([&](const Sequence& sequence) -> Result<Solution> {
    Solution solution;
    const Eigen::MatrixXd root = root_of_result(o, sequence, SharedUnknowns(o));
    solution.U = sequence.U().col(0);
    solution.covariance = root * root.transpose();
    solution.bar_correction_m = Eigen::VectorXd::Zero(3 * std::ssize(o.bar.O_m));
    if (Result<void> done = set_residuals_of_sequence(solution, o, options); !done) {
      return tl::unexpected(done.error());
    }
    return solution;
  });
}

Result<std::vector<Eigen::MatrixXd>> sequential_derivatives(const Observations& o) {
  return finished_sequence(o).map([&](const Sequence& sequence) {
    const Eigen::Index rows = 3 * std::ssize(o.bar.O_m);
    std::vector<Eigen::MatrixXd> of_pass(o.passes.size());
    for (std::size_t m = 0; m < sequence.profiles().size(); ++m) {
      const Profile& p = sequence.profiles()[m];
      for (const std::size_t pass : p.passes) {
        of_pass[pass] = sequence.U().middleCols(1 + rows * static_cast<Eigen::Index>(m), rows) /
                        static_cast<double>(p.passes.size());
      }
    }
    return of_pass;
  });
}

}  // namespace abbe::calib::mfb
