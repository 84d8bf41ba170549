#include "abbe/report/certified_values.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include "abbe/base/units.hpp"
#include "abbe/calib/model/backlash.hpp"

namespace abbe::daemon {
namespace {

using calib::Axis;
using calib::iso::Value;

constexpr std::string_view kNoTravel =
    "the model has no differences between the directions of travel";
constexpr std::string_view kUndetermined =
    "the path does not determine the backlash: an axis moved in one direction only, or on too few "
    "legs";
constexpr std::string_view kNotInModel = "the model has no table for it, or too few nodes";
/// Explains the U of ranges and of largest values.
constexpr std::string_view kOfRanges =
    "Noise of the measurement makes a range larger; U contains this. A range that is not several "
    "times as large as its U is an upper limit.";

/// Number of decimals, 0 to 4, with which `number` has two significant digits; 3 for 0.
int decimals_of(double number) {
  if (!(number > 0.0)) return 3;
  return std::clamp(1 - static_cast<int>(std::floor(std::log10(number))), 0, 4);
}

std::string decimal_text(double number, int decimals) {
  std::string text = fmt::format("{:.{}f}", number, decimals);
  const bool is_zero = text.find_first_not_of("-0.") == std::string::npos;
  return is_zero && text.front() == '-' ? text.substr(1) : text;
}

CertifiedValue not_estimable(std::string key, std::string name, std::string_view why,
                             bool is_angle) {
  return {.key = std::move(key),
          .name = std::move(name),
          .is_angle = is_angle,
          .why = std::string(why)};
}

CertifiedValue certified(std::string key, std::string name, const Value& value, bool is_angle) {
  if (!value.in_model) return not_estimable(std::move(key), std::move(name), kNotInModel, is_angle);
  const double scale = is_angle ? kUradPerRad : kUmPerM;
  const double U = 2.0 * scale * value.u;
  const int decimals = decimals_of(U);
  return {.key = std::move(key),
          .name = std::move(name),
          .value = decimal_text(scale * value.value, decimals),
          .U = decimal_text(U, decimals),
          .is_angle = is_angle,
          .value_si = value.value,
          .u_si = value.u};
}

/// A value without uncertainty. `U_m` determines only the number of decimals.
CertifiedValue without_u(std::string key, std::string name, double length_m, double U_m) {
  return {.key = std::move(key),
          .name = std::move(name),
          .value = decimal_text(kUmPerM * length_m, decimals_of(kUmPerM * U_m)),
          .value_si = length_m};
}

/// A value that needs both directions of travel. `why`: reason for the text if there is no value.
CertifiedValue of_both_directions(std::string key, std::string name,
                                  const std::optional<Value>& value, std::string_view why) {
  if (value) return certified(std::move(key), std::move(name), *value, false);
  return not_estimable(std::move(key), std::move(name), why, false);
}

ValueGroup volume_group(const calib::iso::VolumeError& e) {
  return {
      "Volumetric error",
      fmt::format("|V| of the functional point at {} points of the box, in the datum of the "
                  "model, and without the rigid motion that fits best. U(V) = 2 "
                  "sqrt(u_x^2 + u_y^2 + u_z^2) of the model: |V| that is left after "
                  "compensation is below it with 95 to 99 %, apart from what the uncertainty does "
                  "not contain. Noise of the measurement makes mean and largest |V| larger; U of "
                  "the largest contains this, and the means have no U.",
                  e.points),
      {without_u("V.mean", "before: |V|, mean", e.mean_m, e.max_U_m),
       certified("V.max", "before: |V|, largest", e.largest, false),
       without_u("V.rigid-free.mean", "before, without rigid motion: mean", e.rigid_free_mean_m,
                 e.max_U_m),
       without_u("V.rigid-free.max", "before, without rigid motion: largest", e.rigid_free_max_m,
                 e.max_U_m),
       without_u("U.mean", "after: U(V), mean", e.mean_U_m, e.max_U_m),
       without_u("U.max", "after: U(V), largest", e.max_U_m, e.max_U_m),
       without_u("U.rigid-free.mean", "after: U(V) without rigid motion, mean",
                 e.rigid_free_mean_U_m, e.rigid_free_max_U_m),
       without_u("U.rigid-free.max", "after: U(V) without rigid motion, largest",
                 e.rigid_free_max_U_m, e.rigid_free_max_U_m)}};
}

ValueGroup positioning_group(const calib::iso::StandardValues& standard, std::string_view why) {
  ValueGroup group{
      "Positioning (ISO 230-1, ISO 230-2)",
      "V along the axis on the line through the centre of the box. M: range of the mean of both "
      "directions, which is the range of EXX, EYY, EZZ. E: range over both directions. B: largest "
      "reversal error, forward minus backward. E and B are stated only if the model has "
      "differences between the directions. A, R and s of ISO 230-2 need repeated approaches, "
      "which a model does not contain. " +
          std::string(kOfRanges),
      {}};
  for (const calib::iso::Positioning& p : standard.positioning) {
    const char axis = letter(p.axis);
    group.values.push_back(certified(fmt::format("{}.M", axis),
                                     fmt::format("{0}: M, range of E{0}{0}", axis), p.M, false));
    group.values.push_back(of_both_directions(
        fmt::format("{}.E", axis), fmt::format("{}: E, bidirectional systematic deviation", axis),
        p.E, why));
    group.values.push_back(of_both_directions(
        fmt::format("{}.B", axis), fmt::format("{}: B, reversal error", axis), p.B, why));
  }
  return group;
}

ValueGroup straightness_group(const calib::iso::StandardValues& standard) {
  ValueGroup group{"Straightness (ISO 230-1)",
                   "Range of V across the axis, on the same lines, relative to the least-squares "
                   "straight line over the travel. " +
                       std::string(kOfRanges),
                   {}};
  for (const calib::iso::Straightness& s : standard.straightness) {
    const std::string name = calib::name(s.motion);
    group.values.push_back(certified(
        name, fmt::format("{}: straightness of {} in {}", name, letter(s.motion.axis), name[1]),
        s.range, false));
  }
  return group;
}

ValueGroup squareness_group(const calib::iso::StandardValues& standard) {
  ValueGroup group{"Squareness (ISO 230-1)",
                   "Angle between the least-squares lines of both axes minus 90 degrees, positive "
                   "as a rotation of the first axis about the third direction.",
                   {}};
  for (const calib::iso::Squareness& s : standard.squareness)
    group.values.push_back(
        certified(s.name,
                  fmt::format("{}: {} to {} (reference axis {})", s.name, letter(s.axis),
                              letter(s.reference), letter(s.reference)),
                  s.angle, true));
  return group;
}

ValueGroup angular_group(const calib::iso::StandardValues& standard) {
  ValueGroup group{"Angular errors (ISO 230-1)",
                   "Range over the box. Missing ones cannot be distinguished from other errors "
                   "with the tools of this measurement. " +
                       std::string(kOfRanges),
                   {}};
  for (const calib::iso::Angular& a : standard.angular) {
    const std::string name = calib::name(a.motion);
    const char about = static_cast<char>('X' + (name[1] - 'A'));
    const bool roll = about == letter(a.motion.axis);
    group.values.push_back(
        certified(name,
                  fmt::format("{}: rotation of {} about {}{}", name, letter(a.motion.axis), about,
                              roll ? " (roll)" : ""),
                  a.range, true));
  }
  return group;
}

ValueGroup backlash_group(const calib::VolumetricModel& model) {
  ValueGroup group{
      "Backlash of the tables", "Forward minus backward, the largest of each table.", {}};
  for (const auto& b : calib::largest_of_tables(calib::backlash_of(model)))
    group.values.push_back(certified(calib::name(b.motion) + ".backlash",
                                     calib::name(b.motion) + ": backlash", {b.value, b.u},
                                     is_rotation(b.motion.motion)));
  return group;
}

ValueGroup diagonal_group(const calib::iso::StandardValues& standard, std::string_view why) {
  ValueGroup group{"Diagonals (ISO 230-6)",
                   "V along the body diagonals of the box. P: travel in positive direction of X, "
                   "Y, Z, N: in negative direction. M: range of the mean of both directions. E: "
                   "range over both directions, E_d the largest E; stated only if the model has "
                   "differences between the directions. " +
                       std::string(kOfRanges),
                   {}};
  const calib::iso::Diagonal& longest = standard.diagonal_of_largest_M();
  group.values.push_back(
      certified("M_d", fmt::format("largest M, of {}", longest.name), longest.M, false));
  const calib::iso::Diagonal* worst = standard.diagonal_of_largest_E();
  group.values.push_back(of_both_directions(
      "E_d",
      worst != nullptr ? fmt::format("E_d, diagonal systematic deviation, of {}", worst->name)
                       : "E_d, diagonal systematic deviation",
      worst != nullptr ? worst->E : std::nullopt, why));
  for (const calib::iso::Diagonal& d : standard.diagonals) {
    group.values.push_back(
        certified(d.name + ".M", fmt::format("{}: M, range", d.name), d.M, false));
    group.values.push_back(of_both_directions(
        d.name + ".E", fmt::format("{}: E, bidirectional systematic deviation", d.name), d.E, why));
    group.values.push_back(
        of_both_directions(d.name + ".B", fmt::format("{}: B, reversal error", d.name), d.B, why));
  }
  return group;
}

}  // namespace

Result<CertifiedValues> certified_values(const ModelDocument& document) {
  const auto standard = calib::iso::standard_values(document.model);
  const auto volume = calib::iso::volume_error(document.model);
  if (!standard || !volume)
    return fail(ErrorCode::DataInsufficient,
                fmt::format("model {}: {}", model_id(document),
                            standard ? volume.error().text : standard.error().text));

  CertifiedValues all{.standard = *standard, .volume = *volume, .groups = {}};
  const std::string_view why = document.model.travel() == nullptr ? kNoTravel : kUndetermined;
  all.groups = {volume_group(*volume), positioning_group(*standard, why),
                straightness_group(*standard), squareness_group(*standard)};
  if (!standard->angular.empty()) all.groups.push_back(angular_group(*standard));
  all.groups.push_back(diagonal_group(*standard, why));
  if (document.model.travel() != nullptr) all.groups.push_back(backlash_group(document.model));
  return all;
}

}  // namespace abbe::daemon
