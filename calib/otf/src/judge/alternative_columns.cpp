#include "judge/alternative_columns.hpp"

#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/geometry/rigid_body_model.hpp"

namespace abbe::calib::otf {
namespace {

constexpr std::size_t kRigid = 6, kDrift = 9, kBacklash = 18, kShift = 3;

std::string um(const Vector3& v_m) {
  return message("(", 1e6 * v_m.x(), ", ", 1e6 * v_m.y(), ", ", 1e6 * v_m.z(), ") um");
}

}  // namespace

AlternativeColumns::AlternativeColumns(const Observations& o)
    : o_(o), direction_(travel_along(o.vertices_m, o.mode)) {
  for (const Observation& row : o.rows) {
    centre_m_ += row.axis_position_m / static_cast<double>(o.rows.size());
  }
  last_segment_ = static_cast<double>(std::max<std::size_t>(1, o.rows.back().segment));
}

void AlternativeColumns::rigid(const Observation& row, Values& v) const {
  const Vector3 moment = (row.axis_position_m - centre_m_).cross(row.direction);
  for (std::size_t k = 0; k < 3; ++k) {
    v[k] = row.direction(static_cast<Eigen::Index>(k));
    v[3 + k] = moment(static_cast<Eigen::Index>(k));
  }
}

std::size_t AlternativeColumns::values(const Added& added, const Observation& row,
                                       Values& v) const {
  // A row along the travel compares the point with the scale readings, not with the path.
  const bool compares_with_path = o_.mode == Mode::Standstill || row.component != kAlong;
  if (!compares_with_path && (added.cause == Cause::Vertex || added.cause == Cause::Leg)) {
    return 0;
  }

  switch (added.cause) {
    case Cause::Moved:
      rigid(row, v);
      return row.segment >= added.place ? kRigid : 0;
    case Cause::Drift: {
      rigid(row, v);
      for (Eigen::Index k = 0; k < 3; ++k) {
        v[kRigid + static_cast<std::size_t>(k)] =
            row.direction(k) * (row.axis_position_m(k) - centre_m_(k));
      }
      // -0.5 to 0.5 over the run
      const double time = static_cast<double>(row.segment) / last_segment_ - 0.5;
      for (std::size_t k = 0; k < kDrift; ++k) {
        v[k] *= time;
      }
      return kDrift;
    }
    case Cause::Backlash:
      for (const Axis axis : kAllAxes) {
        const Vector3 l = lever(o_.layout().chain(), axis, row.axis_position_m, o_.target_offset_m);
        const Vector3 moment = l.cross(row.direction);
        const double half = 0.5 * static_cast<double>(direction_[row.leg][index(axis)]);
        for (std::size_t k = 0; k < 3; ++k) {
          v[kRigid * index(axis) + k] = half * row.direction(static_cast<Eigen::Index>(k));
          v[kRigid * index(axis) + 3 + k] = half * moment(static_cast<Eigen::Index>(k));
        }
      }
      return kBacklash;
    case Cause::Vertex: {
      const bool ends_here = row.leg + 1 == added.place, begins_here = row.leg == added.place;
      if (!ends_here && !begins_here) {
        return 0;
      }
      const Vector3 &from = o_.vertices_m[row.leg], &to = o_.vertices_m[row.leg + 1];
      const double share = (row.axis_position_m - from).dot(to - from) / (to - from).squaredNorm();
      for (std::size_t k = 0; k < kShift; ++k) {
        v[k] = (ends_here ? share : 1.0 - share) * row.direction(static_cast<Eigen::Index>(k));
      }
      return kShift;
    }
    case Cause::Leg:
      for (std::size_t k = 0; k < kShift; ++k) {
        v[k] = row.direction(static_cast<Eigen::Index>(k));
      }
      return row.leg == added.place ? kShift : 0;
    case Cause::RangeOffset:
      v[0] = drow_drange_offset(o_, row);
      return 1;
    case Cause::RangeStep:
      v[0] = drow_drange_offset(o_, row);
      return row.segment >= added.place ? 1 : 0;
    default:
      return 0;
  }
}

/// Sums for a step (the tracker or the machine moved) at each of about 100 places of the run, in
/// one pass over the rows: the sums of the rows after a step are the sums of all rows minus those
/// of the rows before the step.
AlternativeColumns::Family AlternativeColumns::steps(std::span<const double> residual_m) const {
  constexpr std::size_t kPlaces = 100, kMargin = 2;
  const std::size_t rows = o_.rows.size(), stride = std::max<std::size_t>(2, rows / kPlaces);
  AddedColumns sum(kRigid, o_.unknowns());
  Family before;
  Values v{};

  for (std::size_t i = 0; i < rows; ++i) {
    const bool new_segment = i == 0 || o_.rows[i].segment != o_.rows[i - 1].segment;
    if (new_segment && i / stride > before.size() && i >= kMargin * stride &&
        i + kMargin * stride <= rows) {
      before.emplace_back(Added{Cause::Moved, o_.rows[i].segment}, sum);
    }
    rigid(o_.rows[i], v);
    sum.add(o_.rows[i], o_.A.row(i), residual_m[i], std::span(v).first(kRigid));
  }

  for (auto& [added, sums] : before) {
    AddedColumns after = sum;
    after -= sums;
    sums = std::move(after);
  }

  return before;
}

/// Sums for an offset of all ranges from the return of the beam on, for the first kMostBreaks
/// breaks that have rows before and after them. The sums are those of the rows from one break to
/// the next, added up from the end of the run.
AlternativeColumns::Family AlternativeColumns::range_steps(
    std::span<const double> residual_m) const {
  constexpr std::size_t kMostBreaks = 50;
  Family after;
  auto next = o_.beam_returned.begin();
  Values v{};

  for (std::size_t i = 0; i < o_.rows.size(); ++i) {
    const std::size_t segment = o_.rows[i].segment;
    if (next != o_.beam_returned.end() && *next <= segment) {
      while (next != o_.beam_returned.end() && *next <= segment) {
        ++next;
      }
      if (i > 0 && after.size() < kMostBreaks) {
        after.emplace_back(Added{Cause::RangeStep, segment}, AddedColumns(1, o_.unknowns()));
      }
    }
    if (!after.empty()) {
      v[0] = drow_drange_offset(o_, o_.rows[i]);
      after.back().second.add(o_.rows[i], o_.A.row(i), residual_m[i], std::span(v).first(1));
    }
  }

  for (std::size_t k = after.size(); k-- > 1;) {
    after[k - 1].second += after[k].second;
  }
  return after;
}

std::vector<AlternativeColumns::Family> AlternativeColumns::sums(
    std::span<const double> residual_m) const {
  std::vector<Family> all(5);
  // A path may have 1e5 vertices; columns are created only for vertices of legs with observations.
  // Rows are in the order of legs, so that only the last two entries are searched.
  const auto columns_of = [&](std::size_t family, Cause cause, std::size_t place,
                              std::size_t columns) -> auto& {
    const auto is_same = [&](const auto& one) { return one.first.place == place; };
    const auto last = all[family].rbegin();
    const auto end = last + std::min<std::ptrdiff_t>(2, std::ssize(all[family]));
    if (const auto found = std::find_if(last, end, is_same); found != end) {
      return *found;
    }
    return all[family].emplace_back(Added{cause, place}, AddedColumns(columns, o_.unknowns()));
  };

  Values v{};
  for (std::size_t i = 0; i < o_.rows.size(); ++i) {
    const Observation& row = o_.rows[i];
    const auto add = [&](std::pair<Added, AddedColumns>& one) {
      if (const std::size_t count = values(one.first, row, v); count > 0) {
        one.second.add(row, o_.A.row(i), residual_m[i], std::span(v).first(count));
      }
    };
    add(columns_of(0, Cause::Drift, 0, kDrift));
    add(columns_of(1, Cause::Backlash, 0, kBacklash));
    add(columns_of(2, Cause::RangeOffset, 0, 1));
    if (o_.mode == Mode::OnTheFly) {  // in standstill mode a vertex is a position
      add(columns_of(3, Cause::Vertex, row.leg, kShift));
      add(columns_of(3, Cause::Vertex, row.leg + 1, kShift));
    }
    add(columns_of(4, Cause::Leg, row.leg, kShift));
  }

  all.push_back(steps(residual_m));
  all.push_back(range_steps(residual_m));
  return all;
}

std::string AlternativeColumns::text(const Added& added, const Eigen::VectorXd& d) const {
  const Vector3 shift = d.size() >= 3 ? Vector3(d.head<3>()) : Vector3::Zero();
  const bool stands = o_.mode == Mode::Standstill;
  switch (added.cause) {
    case Cause::Moved: {
      const auto at = std::find_if(o_.rows.begin(), o_.rows.end(), [&](const Observation& row) {
        return row.segment >= added.place;
      });
      return message("the tracker or the machine moved by ", 1e6 * shift.norm(), " um and ",
                     1e6 * d.segment<3>(3).norm(), " urad (at the centre of the path) ",
                     stands ? "before position " : "on leg ", at == o_.rows.end() ? 0 : at->leg,
                     stands ? " (standstill " : " (segment ", added.place, ")");
    }
    case Cause::Drift:
      return message("the tracker or the machine drifts: by ", 1e6 * shift.norm(), " um, ",
                     1e6 * d.segment<3>(3).norm(), " urad and ", 1e6 * d.tail<3>().norm(),
                     " um/m of length in the run");
    case Cause::Backlash: {
      std::string all;
      for (const Axis axis : kAllAxes) {
        const auto of_axis = d.segment<6>(static_cast<Eigen::Index>(kRigid * index(axis)));
        all += message(all.empty() ? "" : ", ", letter(axis), " ", um(of_axis.head<3>()), " and ",
                       1e6 * of_axis.tail<3>().norm(), " urad");
      }
      return message("the axes have backlash: ", all);
    }
    case Cause::Vertex:
      return message("vertex ", added.place, " was driven at ", um(shift),
                     " relative to the path file");
    case Cause::Leg:
      return message(stands ? "position " : "leg ", added.place, " was driven or measured at ",
                     um(shift), " relative to the path file");
    case Cause::RangeOffset:
      return message("all ranges of the tracker have an offset of ", 1e6 * d(0),
                     " um: home position or reflector");
    case Cause::RangeStep: {
      const auto at = std::find_if(o_.rows.begin(), o_.rows.end(), [&](const Observation& row) {
        return row.segment >= added.place;
      });
      return message("the ranges of the tracker changed by ", 1e6 * d(0),
                     " um at a beam break, or where samples are excluded, before leg ",
                     at == o_.rows.end() ? 0 : at->leg, " (segment ", added.place,
                     "): the distance was set again");
    }
    default:
      return {};
  }
}

}  // namespace abbe::calib::otf
