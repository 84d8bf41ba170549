#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/result/try.hpp"
#include "plan/plan_place.hpp"

namespace abbe::calib::mfb {
namespace {

constexpr std::size_t kNoRole = 3;

enum class Probed { OneSide, BothSides };
/// Place of the bar in NamedSet::Indexed: its place in the other sets, the centre of the rotary
/// axes in the plane of the table only, or the centre.
enum class IndexedPlace { Own, OnTurn, Centre };

/// A measurement of [Viprey 2016] in terms of roles. Roles count from 0: a, b, c.
struct Entry {
  int number = 1;
  std::size_t along = 0, second = kNoRole;  ///< roles of the axes; second: for a diagonal
  double sign = 1.0;                        ///< sign of the component along `second`
  std::size_t holes = 2;
  Probed probed = Probed::OneSide;
  /// Place across the bar as a fraction of the travel of a, b, c. On the reference machine with a
  /// travel of 550 mm these places are 100, 150, 250, 450 and 500 mm.
  std::array<double, 3> at{0.5, 0.5, 0.5};
  IndexedPlace indexed = IndexedPlace::Centre;
};

constexpr double kLow = 2.0 / 11.0, kTable = 3.0 / 11.0, kHigh = 10.0 / 11.0, kFar = 9.0 / 11.0;

std::vector<Entry> entries_of(NamedSet set) {
  const bool minimum = set == NamedSet::Minimum;
  const bool rolled = set == NamedSet::Rolled || set == NamedSet::Indexed;
  const Probed second_side = minimum ? Probed::OneSide : Probed::BothSides;

  std::vector<Entry> all{
      {.along = 0, .at = {0.5, kLow, kTable}, .indexed = IndexedPlace::Own},
      {.number = 2, .along = 0, .at = {0.5, kLow, kHigh}, .indexed = IndexedPlace::OnTurn},
      {.number = 3,
       .along = 0,
       .holes = rolled ? 1u : 2u,
       .at = {0.5, kFar, kTable},
       .indexed = IndexedPlace::Own},
      {.along = 1, .at = {0.5, 0.5, kTable}, .indexed = IndexedPlace::OnTurn},
      {.number = 2, .along = 1, .at = {0.5, 0.5, kHigh}, .indexed = IndexedPlace::OnTurn},
      {.number = 3, .along = 1, .holes = 0, .probed = second_side, .at = {0.5, 0.5, 5.0 / 11.0}},
      {.along = 2, .holes = 0, .probed = Probed::BothSides},
      {.number = 2, .along = 2, .holes = 1, .probed = second_side}};

  for (const double sign : {1.0, -1.0}) {
    if (minimum && sign < 0.0) {
      break;
    }
    const int number = sign > 0.0 ? 1 : 2;
    all.push_back({.number = number,
                   .along = 0,
                   .second = 1,
                   .sign = sign,
                   .at = {0.5, 0.5, kTable},
                   .indexed = IndexedPlace::OnTurn});
    all.push_back({.number = number, .along = 0, .second = 2, .sign = sign, .holes = 1});
    all.push_back({.number = number, .along = 1, .second = 2, .sign = sign, .holes = 0});
  }
  return all;
}

/// Places the entries of one set, one after another.
class SetPlacer {
 public:
  SetPlacer(const PlanTask& task, NamedSet set, const Vector3& centre_m)
      : task_(task), placer_(task), indexed_(set == NamedSet::Indexed), centre_m_(centre_m) {}

  [[nodiscard]] Result<void> add(const Entry& e) {
    const std::string label = label_of(e);
    const std::vector<std::size_t> styli = styli_of(e, label);
    if (styli.empty()) {
      return {};
    }
    const Vector3 z = -task_.styli[styli.front()].stem;
    const std::optional<BarDirection> direction = direction_of(e, z, styli);
    if (!direction) {
      return does_not_fit(e, label, z, styli);
    }
    note_inclination(e, label, *direction);

    const Matrix3 axes = bar_axes(direction->x, z);
    const std::vector<Vector3> centres_m = centres_of(e, direction->angle_rad, styli);
    for (std::size_t i = 0; i < centres_m.size(); ++i) {
      const Vector3 wanted_m = centres_m[i] - 0.5 * placer_.length_m() * direction->x;
      const std::optional<Vector3> origin_m = placer_.nearest(axes, styli, wanted_m);
      const std::string name =
          centres_m.size() > 1 ? message(label, static_cast<char>('a' + i)) : label;
      set_.positions.push_back({name, {*origin_m, axes}, styli});
    }
    if (centres_m.size() > 1) {
      set_.notes.push_back(message(label, ": ", centres_m.size(), " bars overlap along ",
                                   axis_letter(e.along), ", which is longer than the bar"));
    }
    return {};
  }
  [[nodiscard]] PlannedSet take() { return std::move(set_); }

 private:
  [[nodiscard]] std::size_t axis(std::size_t role) const {
    return index(task_.machine.chain.order_w_to_t()[role]);
  }
  [[nodiscard]] char axis_letter(std::size_t role) const {
    return letter(task_.machine.chain.order_w_to_t()[role]);
  }
  [[nodiscard]] std::string label_of(const Entry& e) const {
    return e.second == kNoRole
               ? message(axis_letter(e.along), e.number)
               : message('D', axis_letter(e.along), axis_letter(e.second), e.number);
  }

  std::vector<std::size_t> styli_of(const Entry& e, const std::string& label) {
    const StyliAlong found = styli_along(task_, axis(e.holes));
    const char holes = axis_letter(e.holes);
    std::vector<std::size_t> styli;
    for (const std::optional<std::size_t>& one : {found.against, found.along}) {
      if (one && (styli.empty() || e.probed == Probed::BothSides)) {
        styli.push_back(*one);
      }
    }
    if (styli.empty()) {
      set_.missing.push_back(message(label, ": no stylus has its stem along ", holes));
    } else if (styli.size() == 1 && e.probed == Probed::BothSides) {
      set_.missing.push_back(message(label, " from the second side: no stylus has its stem along ",
                                     found.against ? '+' : '-', holes));
    }
    return styli;
  }

  /// Direction of the bar. Bars that are inclined because two axes are short are perpendicular to
  /// each other, and not parallel to the first diagonal.
  [[nodiscard]] std::optional<BarDirection> direction_of(
      const Entry& e, const Vector3& z, const std::vector<std::size_t>& styli) const {
    if (e.second != kNoRole) {
      return placer_.diagonal(axis(e.along), axis(e.second), e.sign, z, styli);
    }
    const std::size_t other = third_role(e);
    std::optional<BarDirection> direction =
        placer_.along(axis(e.along), axis(other), other > e.along ? 1.0 : -1.0, z, styli);
    constexpr std::size_t kRam = 2;
    if (direction && direction->angle_rad > 0.0 && e.along == kRam) {
      direction->x *= -1.0;  // so that a swivel axis reaches it within 90 degrees
    }
    return direction;
  }
  static std::size_t third_role(const Entry& e) { return 3 - e.along - e.holes; }

  void note_inclination(const Entry& e, const std::string& label, const BarDirection& direction) {
    constexpr double kDegPerRad = 180.0 / std::numbers::pi, kHalfDegree = 0.25;
    const double angle_deg = kDegPerRad * direction.angle_rad;
    if (e.second == kNoRole && angle_deg > kHalfDegree) {
      set_.notes.push_back(message(label, ": ", axis_letter(e.along),
                                   " is shorter than the bar, which is inclined by ", angle_deg,
                                   " degrees towards ", axis_letter(third_role(e))));
    }
    if (e.second != kNoRole && std::abs(angle_deg - 45.0) > kHalfDegree) {
      set_.notes.push_back(message(label, ": ", angle_deg, " degrees from ", axis_letter(e.along),
                                   " instead of 45, because of the travel"));
    }
  }

  /// Places of the middle of the bar: one place, or those of several overlapping bars.
  [[nodiscard]] std::vector<Vector3> centres_of(const Entry& e, double angle_rad,
                                                const std::vector<std::size_t>& styli) const {
    Vector3 centre_m = Vector3::Zero();
    for (std::size_t role = 0; role < 3; ++role) {
      const std::size_t k = axis(role);
      centre_m(static_cast<Eigen::Index>(k)) = placer_.lo_m(k) + e.at[role] * placer_.travel_m(k);
    }
    centre_m += offset_of(e, styli);
    if (indexed_ && e.indexed != IndexedPlace::Own) {
      const auto height = static_cast<Eigen::Index>(axis(2));
      const double at_m = centre_m(height);
      centre_m = centre_m_;
      if (e.indexed == IndexedPlace::OnTurn) {
        centre_m(height) = at_m;
      }
    }
    if (e.second != kNoRole || angle_rad > 0.0) {
      return {centre_m};
    }
    return overlapping(e, centre_m, styli);
  }

  [[nodiscard]] std::vector<Vector3> overlapping(const Entry& e, const Vector3& centre_m,
                                                 const std::vector<std::size_t>& styli) const {
    const auto k = static_cast<Eigen::Index>(axis(e.along));
    const std::vector<double> starts_m = placer_.starts_m(axis(e.along));
    std::vector<Vector3> centres_m(starts_m.size(), centre_m);
    for (std::size_t i = 0; i < starts_m.size() && (!indexed_ || starts_m.size() > 1); ++i) {
      centres_m[i](k) = starts_m[i] + 0.5 * placer_.length_m() + offset_of(e, styli)(k);
    }
    return centres_m;
  }

  /// Offset from the reading to the tip. It is zero along the stem of a stylus across the ram: such
  /// styli are used in opposite pairs, with the bar between them.
  [[nodiscard]] Vector3 offset_of(const Entry& e, const std::vector<std::size_t>& styli) const {
    Vector3 offset_m = Vector3::Zero();
    for (const std::size_t s : styli) {
      offset_m += task_.styli[s].tool_offset_m / static_cast<double>(styli.size());
    }
    constexpr std::size_t kRam = 2;
    if (e.holes != kRam) {
      offset_m(static_cast<Eigen::Index>(axis(e.holes))) = 0.0;
    }
    return offset_m;
  }

  /// Error for a bar that does not fit: the styli need more travel along the holes than there is,
  /// or the bar is too long for its plane.
  [[nodiscard]] tl::unexpected<Error> does_not_fit(const Entry& e, const std::string& label,
                                                   const Vector3& z,
                                                   const std::vector<std::size_t>& styli) const {
    const std::size_t first = axis(e.along);
    const std::size_t second = axis(e.second == kNoRole ? third_role(e) : e.second);
    const std::size_t across = axis(e.holes);
    const ReadingRange range =
        placer_.readings(bar_axes(Vector3::Unit(static_cast<Eigen::Index>(first)), z), styli);
    const double needed_m = (range.max_m - range.min_m)(static_cast<Eigen::Index>(across));
    if (needed_m > placer_.travel_m(across) + 2.0 * placer_.overhang_m(across)) {
      return failure(ErrorCode::NotApplicable,
                     message("plan: ", label, " needs ", std::ceil(1e3 * needed_m), " mm of ",
                             axis_letter(e.holes), " for its styli, the travel is ",
                             1e3 * placer_.travel_m(across), " mm: use styli with shorter arms"));
    }

    const double length_m = placer_.length_m(), other_m = placer_.travel_m(second);
    const double least_m = std::sqrt(std::max(0.0, length_m * length_m - other_m * other_m));
    return failure(
        ErrorCode::NotApplicable,
        message("plan: ", label, " does not fit: from the first to the last hole the bar is ",
                1e3 * length_m, " mm long, the travel is ", 1e3 * placer_.travel_m(first),
                " mm of ", letter(kAllAxes[first]), " and ", 1e3 * other_m, " mm of ",
                letter(kAllAxes[second]), "; with the bar inclined about ",
                std::ceil(1e3 * least_m), " mm of ", letter(kAllAxes[first]),
                " are needed. A pass over a part of the bar is not possible: use a shorter bar"));
  }

  const PlanTask& task_;
  BarPlacer placer_;
  bool indexed_ = false;
  Vector3 centre_m_;
  PlannedSet set_;
};

}  // namespace

std::string_view name(NamedSet set) {
  switch (set) {
    case NamedSet::Paper:
      return "paper";
    case NamedSet::Rolled:
      return "rolled";
    case NamedSet::Minimum:
      return "minimum";
    case NamedSet::Indexed:
      break;
  }
  return "indexed";
}

std::optional<NamedSet> set_named(std::string_view text) {
  for (const NamedSet set : kNamedSets) {
    if (name(set) == text) {
      return set;
    }
  }
  return std::nullopt;
}

std::size_t PlannedSet::measurements() const {
  std::size_t count = 0;
  for (const PlannedPosition& position : positions) {
    count += position.styli.size();
  }
  return count;
}

Result<PlannedSet> named_set(NamedSet set, const PlanTask& task,
                             const std::optional<Vector3>& centre_m) {
  ABBE_TRY(check(task));
  SetPlacer placer(task, set, centre_m.value_or(middle_of_travel(task)));
  for (const Entry& entry : entries_of(set)) {
    ABBE_TRY(placer.add(entry));
  }
  return placer.take();
}

}  // namespace abbe::calib::mfb
