#include "abbe/report/conformity.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "abbe/base/units.hpp"

namespace abbe::daemon {
namespace {

const CertifiedValue* find(const CertifiedValues& values, std::string_view key) {
  for (const ValueGroup& group : values.groups)
    for (const CertifiedValue& value : group.values)
      if (value.key == key) return &value;
  return nullptr;
}

/// True for the values U(V), which are the bound of the error left after compensation.
bool bounds_the_rest(const CertifiedValue& value) {
  return value.key == "U.max" || value.key == "U.rigid-free.max";
}

bool can_be_judged(const CertifiedValue& value) {
  return value.value.empty() || !value.U.empty() || bounds_the_rest(value);
}

std::string keys_that_can_be_judged(const CertifiedValues& values) {
  std::string keys;
  for (const ValueGroup& group : values.groups)
    for (const CertifiedValue& value : group.values)
      if (can_be_judged(value)) keys += (keys.empty() ? "" : " ") + value.key;
  return keys;
}

/// True for the name of an error of ISO 230-1: "EYX", "EC0Y". Its second letter determines its
/// unit.
bool is_error_name(std::string_view key) {
  const auto any_of = [key](std::size_t i, std::string_view letters) {
    return letters.find(key[i]) != std::string_view::npos;
  };
  if (key.size() == 3) return key[0] == 'E' && any_of(1, "XYZABC") && any_of(2, "XYZ");
  return key.size() == 4 && key[0] == 'E' && any_of(1, "ABC") && key[2] == '0' && any_of(3, "XYZ");
}

/// The value of an error that the model does not have: with a single tool offset, not all errors
/// can be distinguished.
CertifiedValue not_in_model(const std::string& key) {
  return {.key = key,
          .name = key,
          .is_angle = std::string_view("ABC").find(key[1]) != std::string_view::npos,
          .why = "the measurement does not distinguish it from the other errors"};
}

/// The reason why the limit cannot be judged; nullopt: it can be judged.
std::optional<std::string> fault_of(const CertifiedValue* value, const ToleranceDetails& limit) {
  if (value == nullptr) return "the model has no such value";
  if (!can_be_judged(*value)) return "it has no uncertainty";
  if (value->is_angle != limit.is_angle)
    return value->is_angle ? "it is an angle: limit_urad" : "it is a length: limit_um";
  return std::nullopt;
}

JudgedValue judged(const CertifiedValue& value, const ToleranceDetails& limit) {
  JudgedValue one{
      .value = value,
      .limit = fmt::format("{:.6g} {}", limit.limit_um_urad, limit.is_angle ? "urad" : "um")};
  if (value.value.empty()) return one;
  const double scale = limit.is_angle ? kUradPerRad : kUmPerM;
  const bool is_bound = bounds_the_rest(value);
  one.conformity =
      conformity_of(is_bound ? 0.0 : scale * value.value_si,
                    scale * (is_bound ? value.value_si : 2.0 * value.u_si), limit.limit_um_urad);
  return one;
}

}  // namespace

std::string_view name(Conformity conformity) noexcept {
  constexpr std::array<std::string_view, 3> kNames{"pass", "fail", "neither"};
  return kNames[static_cast<std::size_t>(conformity)];
}

Conformity conformity_of(double value, double U, double limit) noexcept {
  if (std::abs(value) + U <= limit) return Conformity::Pass;
  return std::abs(value) - U > limit ? Conformity::Fail : Conformity::Neither;
}

Result<std::vector<JudgedValue>> judge(const CertifiedValues& values,
                                       const std::vector<ToleranceDetails>& limits) {
  std::vector<JudgedValue> all;
  std::vector<std::string> faults;
  for (const ToleranceDetails& limit : limits) {
    const CertifiedValue* value = find(values, limit.value);
    std::optional<CertifiedValue> missing;
    if (value == nullptr && is_error_name(limit.value))
      value = &missing.emplace(not_in_model(limit.value));
    if (const auto fault = fault_of(value, limit))
      faults.push_back(fmt::format("[[tolerance]] value = \"{}\": {}", limit.value, *fault));
    else
      all.push_back(judged(*value, limit));
  }
  if (faults.empty()) return all;
  faults.push_back("values with an uncertainty: " + keys_that_can_be_judged(values));
  return tl::make_unexpected(
      Error{ErrorCode::BadInput, "report: limits cannot be judged", std::move(faults)});
}

Conformity conformity_of_all(const std::vector<JudgedValue>& judged) noexcept {
  const auto has = [&judged](Conformity wanted) {
    return std::ranges::any_of(judged, [wanted](auto& one) { return one.conformity == wanted; });
  };
  if (has(Conformity::Fail)) return Conformity::Fail;
  return has(Conformity::Neither) ? Conformity::Neither : Conformity::Pass;
}

}  // namespace abbe::daemon
