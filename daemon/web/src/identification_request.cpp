#include "identification_request.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>

#include "abbe/config/gate_conditions.hpp"
#include "abbe/result/try.hpp"

namespace abbe::web {
namespace {

using daemon::ErrorCode;
using daemon::Result;
using nlohmann::json;
using Words = std::span<const std::string_view>;

constexpr std::size_t kLongestNumbers = 100;
constexpr int kLeastOrder = 1, kMostOrder = 5;

constexpr std::array<std::string_view, 2> kConfigurations{"recorded", "present"};
constexpr std::array<std::string_view, 3> kTables{"linear", "cubic", "not-a-knot-cubic"};
constexpr std::array<std::string_view, 3> kBacklash{"none", "per-table", "forward-backward"};
constexpr std::array<std::string_view, 2> kOtfEstimators{"simultaneous", "two-step"};
constexpr std::array<std::string_view, 6> kArrayEstimators{"bayes-pose", "ols", "ridge",
                                                           "lasso",      "mcp", "scad"};
constexpr std::array<std::string_view, 2> kBarEstimators{"simultaneous", "sequential"};

/// Takes the members of a request one after the other.
class Members {
 public:
  explicit Members(const json& body) : left_(body) {}

  /// Empty: the member is missing, or empty as in a form.
  Result<std::string> word(const char* member, Words words) {
    std::string given = text(member);
    if (given.empty() || std::ranges::find(words, given) != words.end()) {
      if (!given.empty()) options_.push_back(fmt::format("{} {}", member, given));
      return given;
    }
    return daemon::fail(ErrorCode::Usage, fmt::format("{} \"{}\": must be {}", member,
                                                      shortened(given), fmt::join(words, ", ")));
  }
  /// Its content is checked by the task.
  Result<std::string> numbers(const char* member) {
    std::string given = text(member);
    if (given.size() > kLongestNumbers)
      return daemon::fail(ErrorCode::Usage,
                          fmt::format("{}: has {} characters, at most {} are read", member,
                                      given.size(), kLongestNumbers));
    if (!given.empty()) options_.push_back(fmt::format("{} {}", member, given));
    return given;
  }
  Result<std::optional<int>> number(const char* member, int least, int most) {
    const auto given = take(member);
    if (given.is_null()) return std::nullopt;
    const auto value = given.get<double>();
    for (int whole = least; whole <= most; ++whole) {
      if (value != whole) continue;
      options_.push_back(fmt::format("{} {}", member, whole));
      return whole;
    }
    return daemon::fail(ErrorCode::Usage, fmt::format("{} {}: must be a whole number, {} to {}",
                                                      member, value, least, most));
  }
  Result<std::vector<std::string>> conditions(const char* member) {
    const auto given = take(member);
    if (given.is_null()) return {};
    auto names = given.get<std::vector<std::string>>();
    const auto known = daemon::gate_conditions();
    for (const std::string& name : names)
      if (std::ranges::find(known, name) == known.end())
        return daemon::fail(ErrorCode::Usage, fmt::format("{} \"{}\": must be {}", member,
                                                          shortened(name), fmt::join(known, ", ")));
    if (!names.empty()) options_.push_back(fmt::format("{} {}", member, fmt::join(names, ", ")));
    return names;
  }
  /// Usage if a member was not taken: it would have no effect.
  [[nodiscard]] Result<void> none_left(std::string_view method) const {
    if (left_.empty()) return {};
    return daemon::fail(ErrorCode::Usage, fmt::format("\"{}\" is no option of method {}",
                                                      shortened(left_.begin().key()), method));
  }
  std::string text(const char* member) {
    const auto given = take(member);
    return given.is_null() ? std::string{} : given.get<std::string>();
  }
  [[nodiscard]] const std::vector<std::string>& options() const { return options_; }

 private:
  static std::string shortened(const std::string& text) { return text.substr(0, 40); }
  json take(const char* member) {
    const auto found = left_.find(member);
    if (found == left_.end()) return {};
    json value = std::move(*found);
    left_.erase(found);
    return value;
  }

  json left_;
  std::vector<std::string> options_;
};

Result<daemon::AgainArguments> otf_arguments(Members& members) {
  daemon::IdentifyOtfArguments arguments;
  auto tables = members.word("tables", kTables);
  ABBE_TRY(tables);
  auto backlash = members.word("backlash", kBacklash);
  ABBE_TRY(backlash);
  auto smoothness = members.numbers("smoothness_um");
  ABBE_TRY(smoothness);
  auto estimator = members.word("estimator", kOtfEstimators);
  ABBE_TRY(estimator);
  arguments.tables = std::move(*tables);
  arguments.backlash = std::move(*backlash);
  arguments.smoothness = std::move(*smoothness);
  if (!estimator->empty()) arguments.estimator = std::move(*estimator);
  return arguments;
}

Result<daemon::AgainArguments> array_arguments(Members& members) {
  daemon::IdentifyEvemuArguments arguments;
  auto estimator = members.word("estimator", kArrayEstimators);
  ABBE_TRY(estimator);
  const auto order = members.number("order", kLeastOrder, kMostOrder);
  ABBE_TRY(order);
  if (!estimator->empty()) arguments.estimator = std::move(*estimator);
  arguments.input.order = *order;
  return arguments;
}

Result<daemon::AgainArguments> bar_arguments(Members& members) {
  daemon::IdentifyMfbArguments arguments;
  auto estimator = members.word("estimator", kBarEstimators);
  ABBE_TRY(estimator);
  if (!estimator->empty()) arguments.estimator = std::move(*estimator);
  return arguments;
}

Result<daemon::AgainArguments> arguments_of(const std::string& method, Members& members) {
  if (method == "otf") return otf_arguments(members);
  if (method == "evemu") return array_arguments(members);
  if (method == "mfb") return bar_arguments(members);
  return daemon::fail(ErrorCode::Usage, fmt::format("method \"{}\": must be otf, evemu or mfb",
                                                    method.substr(0, 40)));
}

}  // namespace

Result<IdentificationRequest> identification_request(const json& body) {
  Members members{body};
  IdentificationRequest request;
  request.recording = body.at("name").get<std::string>();
  const auto method = body.at("method").get<std::string>();
  (void)members.text("name");
  (void)members.text("method");
  const auto configuration = members.word("configuration", kConfigurations);
  ABBE_TRY(configuration);
  request.present_configuration = *configuration == "present";
  auto arguments = arguments_of(method, members);
  ABBE_TRY(arguments);
  auto accept = members.conditions("accept");
  ABBE_TRY(accept);
  ABBE_TRY(members.none_left(method));

  request.arguments = std::move(*arguments);
  std::visit([&accept](auto& of_method) { of_method.accept = *accept; }, request.arguments);
  request.accept = std::move(*accept);
  request.options = members.options();
  return request;
}

}  // namespace abbe::web
