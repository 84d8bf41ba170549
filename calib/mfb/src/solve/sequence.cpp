#include "solve/sequence.hpp"

#include <algorithm>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::mfb {

Sequence::Sequence(const Observations& o, std::vector<Profile> profiles, SequentialRoles roles)
    : o_(o),
      profiles_(std::move(profiles)),
      roles_(std::move(roles)),
      known_(o.basis.size(), false) {
  const Eigen::Index rows = 3 * std::ssize(o.bar.O_m);
  const Eigen::Index columns = 1 + rows * std::ssize(profiles_);
  U_ = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(o.basis.size()), columns);
  for (std::size_t m = 0; m < profiles_.size(); ++m) {
    delta_.push_back(in_machine_axes(m, 1 + rows * static_cast<Eigen::Index>(m), columns));
  }
}

Result<void> Sequence::run() {
  Result<void> done =
      x_stage().and_then([&] { return y_stage(); }).and_then([&] { return z_stage(); });
  if (done) {
    squareness_stage();
  }
  return done;
}

Sequence::Delta Sequence::in_machine_axes(std::size_t m, Eigen::Index first,
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

Sequence::Delta Sequence::without_known(std::size_t m) const {
  const Profile& p = profiles_[m];
  Delta d = delta_[m];
  std::vector<Column> memory(o_.basis.most_columns());
  for (std::size_t row = 0; row < p.hole.size(); ++row) {
    ModelColumns columns(memory);
    o_.basis.append_columns({.q_m = p.on_axis_m[row] - p.tool_m, .tool_offset_m = p.tool_m},
                            columns);
    for (const Column& c : columns.span()) {
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

Sequence::Delta Sequence::from_first(std::size_t m) const {
  Delta d = without_known(m);
  for (HoleRows& rows : d) {
    rows.rowwise() -= rows.row(0).eval();
  }
  return d;
}

Eigen::VectorXd Sequence::tip(std::size_t m, Eigen::Index axis) const {
  Eigen::VectorXd values(std::ssize(profiles_[m].on_axis_m));
  for (std::size_t i = 0; i < profiles_[m].on_axis_m.size(); ++i) {
    values(static_cast<Eigen::Index>(i)) = profiles_[m].on_axis_m[i](axis);
  }
  return values;
}

HoleRows Sequence::slope(const ProfilePair& pair, std::size_t direction) const {
  return (from_first(pair.second)[direction] - from_first(pair.first)[direction]) /
         pair.difference_m;
}

HoleRows Sequence::detrended(HoleRows rows, std::size_t m, Eigen::Index axis) const {
  const Eigen::VectorXd x = tip(m, axis);
  const Eigen::Index last = x.size() - 1;
  const Eigen::VectorXd t = (x.array() - x(0)) / (x(last) - x(0));
  const Eigen::RowVectorXd first = rows.row(0), rise = rows.row(last) - first;
  rows.rowwise() -= first;
  rows -= t * rise;
  rows.row(last).setZero();  // exactly zero, without rounding errors
  return rows;
}

Result<HoleRows> Sequence::at_nodes(Axis a, const HoleRows& values, std::size_t m) const {
  const Profile& p = profiles_[m];
  const auto axis = static_cast<Eigen::Index>(index(a));
  const std::vector<double>& nodes_m = o_.basis.layout().nodes()[index(a)].nodes_m;
  std::vector<double> readings_m;
  for (const Vector3& tip_m : p.on_axis_m) {
    readings_m.push_back(tip_m(axis) - p.tool_m(axis));
  }
  const double half_m = 0.5 * (nodes_m[1] - nodes_m[0]);
  if (nodes_m.front() < readings_m.front() - half_m ||
      nodes_m.back() > readings_m.back() + half_m) {
    return failure(
        ErrorCode::NotApplicable,
        message("sequential estimator: the bar does not cover the nodes of ", letter(a)));
  }

  return AxisInterpolation::of(readings_m, Interpolation::NotAKnotCubic)
      .map([&](const AxisInterpolation& holes) {
        HoleRows rows = HoleRows::Zero(std::ssize(nodes_m), values.cols());
        for (std::size_t k = 0; k < nodes_m.size(); ++k) {
          const NodeWeights w = holes.at(nodes_m[k]);
          for (std::size_t i = 0; i < w.count(); ++i) {
            rows.row(static_cast<Eigen::Index>(k)) +=
                w[i] * values.row(static_cast<Eigen::Index>(w.first() + i));
          }
        }
        return rows;
      });
}

void Sequence::impose_datum(ErrorMotion motion, Eigen::Ref<Eigen::MatrixXd> rows) const {
  const AxisNodes& axis = o_.basis.layout().nodes()[index(motion.axis)];
  const Eigen::Index last = rows.rows() - 1;
  if (is_straightness(motion)) {
    const Eigen::RowVectorXd begin = rows.row(0), rise = rows.row(last) - begin;
    const Eigen::Map<const Eigen::VectorXd> x(axis.nodes_m.data(), last + 1);
    rows.rowwise() -= begin;
    rows -= ((x.array() - x(0)) / (x(last) - x(0))).matrix() * rise;
    rows.row(last).setZero();  // exactly zero, without rounding errors
    return;
  }

  const NodeWeights w = o_.basis.interpolation(motion.axis).at(axis.reference_m);
  Eigen::RowVectorXd at_reference = Eigen::RowVectorXd::Zero(rows.cols());
  for (std::size_t i = 0; i < w.count(); ++i) {
    at_reference += w[i] * rows.row(static_cast<Eigen::Index>(w.first() + i));
  }
  rows.rowwise() -= at_reference;
}

Result<void> Sequence::set(ErrorMotion motion, const HoleRows& values, std::size_t m) {
  const Result<HoleRows> found = at_nodes(motion.axis, values, m);
  ABBE_TRY(found);
  const auto first = static_cast<Eigen::Index>(o_.basis.layout().find(motion)->offset);
  U_.middleRows(first, found->rows()) = *found;
  impose_datum(motion, U_.middleRows(first, found->rows()));
  std::fill_n(known_.begin() + first, found->rows(), true);
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

void Sequence::squareness_stage() {
  const auto difference = [&](const std::array<std::size_t, 2>& pair) {
    return Eigen::RowVectorXd(slope_along_bar(pair[0]) - slope_along_bar(pair[1]));
  };
  const auto EA0Z = static_cast<Eigen::Index>(o_.basis.layout().squareness_offset());
  U_.row(EA0Z) = difference(roles_.diagonals[2]);
  U_.row(EA0Z + 1) = -difference(roles_.diagonals[1]);
  U_.row(EA0Z + 2) = difference(roles_.diagonals[0]);
}

}  // namespace abbe::calib::mfb
