#include "abbe/calib/internal/otf/standstill/standstill_assignment.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "abbe/calib/geometry/usual_mistakes.hpp"
#include "abbe/calib/internal/base/check_stopped.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/geometry/range_change.hpp"
#include "abbe/calib/otf/run/polyline.hpp"
#include "abbe/result/try.hpp"
#include "run/match_in_order.hpp"
#include "run/path_corrections.hpp"

namespace abbe::calib::otf {
namespace {

/// Number of points of a first correspondence, and tolerance of the distances between them: each
/// point may have an error up to Options::max_alignment_rms_m.
constexpr std::size_t kSeedPoints = 6;
constexpr double kSeedTolerance_m = 3e-3;
/// Tolerance of the assignment with the pose from a first correspondence, whose rotation is
/// uncertain.
constexpr double kRoughTolerance_m = 10e-3;

/// A pose of the tracker with its assignment.
struct Hypothesis {
  RigidTransform T_machine_tracker;
  OrderedMatch match;
};

/// Input data of one assignment.
struct Problem {
  std::span<const Standstill> standstills;
  const Vector3& target_offset_m;
  std::vector<Vector3> measured_m;  ///< positions of the standstills, tracker frame
  std::vector<Vector3> nominal_m;   ///< nominal axis positions
  double most_samples = 1.0;

  [[nodiscard]] std::vector<MeasuredPlace> places(const RigidTransform& T) const {
    std::vector<MeasuredPlace> all;
    all.reserve(measured_m.size());
    for (std::size_t i = 0; i < measured_m.size(); ++i) {
      all.push_back({T * measured_m[i] - target_offset_m,
                     static_cast<double>(standstills[i].samples) / most_samples});
    }
    return all;
  }

  [[nodiscard]] OrderedMatch match(const RigidTransform& T, double tolerance_m) const {
    return match_in_order(places(T), nominal_m, tolerance_m);
  }
};

Problem problem_of(std::span<const Standstill> standstills, const Machine& machine,
                   const Path& path) {
  Problem p{.standstills = standstills,
            .target_offset_m = machine.target_offset_m,
            .measured_m = {},
            .nominal_m = path.vertices_m};
  for (const Standstill& s : standstills) {
    p.measured_m.push_back(s.mean_tracker_m);
    p.most_samples = std::max(p.most_samples, static_cast<double>(s.samples));
  }
  return p;
}

/// True if the distances between successive points agree, and those between every second point.
bool same_distances(std::span<const Vector3> a, std::span<const Vector3> b) {
  for (std::size_t i = 1; i < a.size(); ++i) {
    for (std::size_t back = 1; back <= std::min<std::size_t>(2, i); ++back) {
      const double difference_m = (a[i] - a[i - back]).norm() - (b[i] - b[i - back]).norm();
      if (!(std::abs(difference_m) <= kSeedTolerance_m)) {
        return false;
      }
    }
  }
  return true;
}

/// The pose for which a few successive standstills are at successive positions; nullopt: none.
std::optional<RigidTransform> pose_of(std::span<const Vector3> measured_m,
                                      std::span<const Vector3> nominal_m, const Vector3& t) {
  if (!same_distances(measured_m, nominal_m)) {
    return std::nullopt;
  }
  std::vector<Vector3> targets;
  for (const Vector3& q : nominal_m) {
    targets.emplace_back(q + t);
  }
  const Result<RigidTransform> T = fit_rigid(measured_m, targets);
  if (!T) {
    return std::nullopt;
  }
  for (std::size_t i = 0; i < targets.size(); ++i) {
    if (!((*T * measured_m[i] - targets[i]).norm() <= kSeedTolerance_m)) {
      return std::nullopt;
    }
  }
  return *T;
}

/// The best hypothesis from first correspondences. In a correspondence the index of the standstill
/// may differ from that of the position by up to `most_shift`. A few correspondences are tried for
/// each shift.
Result<std::optional<Hypothesis>> first_hypothesis(const Problem& p, const Options& options) {
  constexpr std::size_t kTries = 3;
  constexpr std::ptrdiff_t kFewestShifts = 3;
  constexpr double kEnough = 0.95;
  const std::size_t n = p.nominal_m.size(), m = p.measured_m.size();
  const std::size_t points = std::min({kSeedPoints, n, m});
  const auto most_shift = kFewestShifts +
                          std::abs(std::ssize(p.nominal_m) - std::ssize(p.measured_m)) +
                          std::lround(options.standstill.most_unmatched * static_cast<double>(n));
  std::optional<Hypothesis> best;

  for (std::ptrdiff_t k = 0; k <= 2 * most_shift; ++k) {
    const std::ptrdiff_t shift = k % 2 == 0 ? k / 2 : -(k + 1) / 2;
    std::size_t tries = 0;
    for (std::size_t a = 0; a + points <= m && tries < kTries; a += 2) {
      const std::ptrdiff_t b = static_cast<std::ptrdiff_t>(a) + shift;
      if (b < 0 || static_cast<std::size_t>(b) + points > n) {
        continue;
      }
      const auto T = pose_of(std::span(p.measured_m).subspan(a, points),
                             std::span(p.nominal_m).subspan(static_cast<std::size_t>(b), points),
                             p.target_offset_m);
      if (!T) {
        continue;
      }
      ++tries;
      Hypothesis h{*T, p.match(*T, kRoughTolerance_m)};
      if (!best || h.match.matched > best->match.matched) {
        best = std::move(h);
      }
      if (static_cast<double>(best->match.matched) >=
          kEnough * static_cast<double>(std::min(n, m))) {
        return best;
      }
    }
    ABBE_TRY(check_stopped(options.stopped));
  }

  return best;
}

/// Best-fit pose of the assigned standstills on their positions.
Result<RigidTransform> fit_assigned(const Problem& p, const OrderedMatch& match) {
  std::vector<Vector3> from, to;
  for (std::size_t j = 0; j < p.nominal_m.size(); ++j) {
    if (const auto i = match.measured_of[j]) {
      from.push_back(p.measured_m[*i]);
      to.emplace_back(p.nominal_m[j] + p.target_offset_m);
    }
  }
  return fit_rigid(from, to);
}

/// Repeats fit and assignment until the assignment does not change. Returns the number of updates.
Result<int> refine(Hypothesis& h, const Problem& p, double tolerance_m) {
  constexpr int kMostUpdates = 20;
  for (int update = 1;; ++update) {
    const Result<RigidTransform> T = fit_assigned(p, h.match);
    if (!T) {
      return failure(T.error().code, message("standstills: ", T.error().text));
    }
    h.T_machine_tracker = *T;
    OrderedMatch next = p.match(*T, tolerance_m);
    const bool same = next.measured_of == h.match.measured_of;
    h.match = std::move(next);
    if (same || update == kMostUpdates) {
      return update;
    }
  }
}

/// Text such as "213.4 to 214.4 s".
std::string when(const Standstill& s) {
  return message(s.begin_s, " to ", s.end_s, " s");
}

std::string position_text(std::size_t j, const Path& path) {
  return message("position ", j, ", ", mm_text(path.vertices_m[j]));
}

StandstillAssignment assignment_of(const Hypothesis& h, const Problem& p, double tolerance_m) {
  StandstillAssignment a{.T_machine_tracker = h.T_machine_tracker,
                         .standstill_of = h.match.measured_of};
  std::vector<bool> used(p.measured_m.size(), false);
  double squares = 0.0;

  for (std::size_t j = 0; j < p.nominal_m.size(); ++j) {
    const auto i = h.match.measured_of[j];
    if (!i) {
      a.missed.push_back(j);
      continue;
    }
    used[*i] = true;
    const double distance_m =
        (h.T_machine_tracker * p.measured_m[*i] - p.target_offset_m - p.nominal_m[j]).norm();
    squares += distance_m * distance_m;
    if (distance_m > a.farthest_m) {
      a.farthest_m = distance_m;
      a.farthest_position = j;
    }
  }
  a.rms_m = std::sqrt(squares / static_cast<double>(std::max<std::size_t>(1, h.match.matched)));

  for (std::size_t i = 0; i < used.size(); ++i) {
    if (used[i]) {
      continue;
    }
    const Vector3 q = h.T_machine_tracker * p.measured_m[i] - p.target_offset_m;
    const auto nearest = std::min_element(p.nominal_m.begin(), p.nominal_m.end(),
                                          [&](const Vector3& x, const Vector3& y) {
                                            return (x - q).squaredNorm() < (y - q).squaredNorm();
                                          });
    ExtraStandstill extra{.standstill = i, .axis_position_m = q, .visited_again = {}};
    if ((*nearest - q).norm() <= tolerance_m) {
      extra.visited_again = static_cast<std::size_t>(nearest - p.nominal_m.begin());
    }
    a.extra.push_back(extra);
  }

  return a;
}

/// Text of the first difference between the distances of successive standstills and positions.
std::string first_difference(const Problem& p, const Path& path) {
  const std::size_t n = std::min(p.measured_m.size(), p.nominal_m.size());
  for (std::size_t i = 1; i < n; ++i) {
    const double seen_m = (p.measured_m[i] - p.measured_m[i - 1]).norm();
    const double path_m = (p.nominal_m[i] - p.nominal_m[i - 1]).norm();
    if (std::abs(seen_m - path_m) > kSeedTolerance_m) {
      return message("the first difference is at ", when(p.standstills[i]),
                     ": there the target is ", 1e3 * seen_m, " mm from the standstill before, ",
                     position_text(i, path), ", is ", 1e3 * path_m, " mm from the position before");
    }
  }
  return "the distances between successive points agree, the shape of the path does not";
}

/// Text about the first position without a standstill, and the place where the machine stood
/// instead.
std::string first_missed(const StandstillAssignment& a, const Problem& p, const Path& path) {
  const std::size_t j = a.missed.front();
  std::string text = message("the first is ", position_text(j, path));
  std::size_t next = 0;
  if (j > 0 && a.standstill_of[j - 1]) {
    const std::size_t before = *a.standstill_of[j - 1];
    text +=
        message("; at the position before it the target stood from ", when(p.standstills[before]));
    next = before + 1;
  }

  if (next < p.standstills.size()) {
    const Vector3 q = a.T_machine_tracker * p.measured_m[next] - p.target_offset_m;
    text += message(", at the next standstill, ", when(p.standstills[next]), ", at ", mm_text(q));
  }
  return text;
}

/// Returns AlignmentFailed if too many points are unassigned, or too far apart.
Result<void> check_assignment(const StandstillAssignment& a, const Problem& p, const Path& path,
                              const Options& options) {
  const double most = options.standstill.most_unmatched;
  const std::size_t n = p.nominal_m.size(), m = p.measured_m.size();
  if (static_cast<double>(a.missed.size()) > most * static_cast<double>(n)) {
    return failure(ErrorCode::AlignmentFailed,
                   message("standstills: ", a.missed.size(), " of ", n,
                           " positions of the path have no standstill, limit ", 100.0 * most,
                           " %: ", first_missed(a, p, path)));
  }

  if (static_cast<double>(a.extra.size()) > most * static_cast<double>(m)) {
    return failure(
        ErrorCode::AlignmentFailed,
        message("standstills: ", a.extra.size(), " of ", m,
                " standstills are at no position of the path, limit ", 100.0 * most,
                " %: the first is from ", when(p.standstills[a.extra.front().standstill]), " at ",
                mm_text(a.extra.front().axis_position_m)));
  }

  if (!(a.rms_m <= options.max_alignment_rms_m)) {
    return failure(
        ErrorCode::AlignmentFailed,
        message("standstills: rms distance to the positions is ", 1e3 * a.rms_m, " mm, limit ",
                1e3 * options.max_alignment_rms_m, " mm; the farthest is ",
                position_text(a.farthest_position, path), ": ", 1e3 * a.farthest_m, " mm"));
  }

  return {};
}

Result<StandstillAssignment> assign_as_given(std::span<const Standstill> standstills,
                                             const Machine& machine, const Path& path,
                                             const Options& options) {
  const Problem p = problem_of(standstills, machine, path);
  Result<std::optional<Hypothesis>> h = first_hypothesis(p, options);
  ABBE_TRY(h);

  if (!*h) {
    return failure(
        ErrorCode::AlignmentFailed,
        message("standstills: the ", p.measured_m.size(), " standstills do not match the ",
                p.nominal_m.size(), " positions of this path: ", first_difference(p, path)));
  }

  const RigidTransform rough = (*h)->T_machine_tracker;
  const double tolerance_m = options.max_alignment_distance_m;
  const Result<int> updates = refine(**h, p, tolerance_m);
  ABBE_TRY(updates);

  StandstillAssignment a = assignment_of(**h, p, tolerance_m);
  a.rough_T_machine_tracker = rough;
  a.iterations = *updates;
  ABBE_TRY(check_assignment(a, p, path, options));
  return a;
}

/// TooFewObservations for too few standstills; BadInput for so many points that the assignment
/// would take more than a second.
Result<void> check_size(std::size_t standstills, std::size_t positions) {
  constexpr std::size_t kFewest = 4, kMost = 3000;
  if (standstills < kFewest) {
    return failure(ErrorCode::TooFewObservations,
                   message("standstills: ", standstills, " found, needs at least ", kFewest));
  }
  if (standstills > kMost || positions > kMost) {
    return failure(ErrorCode::BadInput, message("standstills: ", standstills, " standstills and ",
                                                positions, " positions, limit ", kMost));
  }
  return {};
}

/// True if the standstills match the positions after all points of the tracker are replaced by
/// `corrected(point)`.
template <class Corrected>
bool fits_with_points(std::span<const Standstill> standstills, const Corrected& corrected,
                      const Machine& machine, const Path& path, const Options& options) {
  if (options.stopped && options.stopped()) {
    return false;
  }
  std::vector<Standstill> changed(standstills.begin(), standstills.end());
  for (Standstill& s : changed) {
    s.mean_tracker_m = corrected(s.mean_tracker_m);
  }
  return assign_as_given(changed, machine, path, options).has_value();
}

/// Text such as "; they fit with ranges shorter by 19.05 mm (...)" if the radius of a usual
/// reflector, added to or subtracted from all ranges, makes the standstills match the positions;
/// else empty.
std::string reflector_that_fits(std::span<const Standstill> standstills, const Machine& machine,
                                const Path& path, const Options& options) {
  for (const double radius_m : reflector_radii_m()) {
    for (const double change_m : {-radius_m, radius_m}) {
      const auto longer = [&](const Vector3& p) { return with_longer_range(p, change_m); };
      if (fits_with_points(standstills, longer, machine, path, options)) {
        return "; they fit with " + range_change_text(change_m);
      }
    }
  }
  return "";
}

}  // namespace

Result<StandstillAssignment> assign_standstills(std::span<const Standstill> standstills,
                                                const Machine& machine, const Path& path,
                                                const Options& options) {
  Result<void> valid = check(path);
  if (valid) {
    valid = check_size(standstills.size(), path.vertices_m.size());
  }
  ABBE_TRY(valid);

  Result<StandstillAssignment> a = assign_as_given(standstills, machine, path, options);
  if (!a && a.error().code == ErrorCode::AlignmentFailed) {
    std::string corrections = corrections_that_fit(path, machine.nodes, [&](const Path& other) {
      return !(options.stopped && options.stopped()) &&
             assign_as_given(standstills, machine, other, options).has_value();
    });
    if (corrections.empty()) {
      corrections = angles_that_fit([&](const AngleMistake& mistake) {
        return fits_with_points(standstills, mistake.corrected, machine, path, options);
      });
    }
    if (corrections.empty()) {
      corrections = reflector_that_fits(standstills, machine, path, options);
    }
    a.error().text += corrections;
  }
  return a;
}

std::vector<std::string> notes_of(const StandstillAssignment& a,
                                  std::span<const Standstill> standstills, const Path& path) {
  constexpr std::size_t kMost = 10;
  std::vector<std::string> notes;
  for (const std::size_t j : a.missed) {
    notes.push_back(message("no standstill at ", position_text(j, path), ": not in the model"));
  }

  for (const ExtraStandstill& extra : a.extra) {
    const std::string at = when(standstills[extra.standstill]);
    notes.push_back(extra.visited_again
                        ? message("the machine stood again at ",
                                  position_text(*extra.visited_again, path), ", from ", at,
                                  ": not used")
                        : message("the machine stood at ", mm_text(extra.axis_position_m), " from ",
                                  at, ", which is no position of the path: not used"));
  }

  if (notes.size() > kMost) {
    const std::size_t others = notes.size() - kMost;
    notes.resize(kMost);
    notes.push_back(message(others, " other positions or standstills were left out"));
  }
  return notes;
}

}  // namespace abbe::calib::otf
