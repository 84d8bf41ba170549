#pragma once
/// A list of calibration methods, and the types and functions that method-independent code derives
/// from it. A method is a struct without data members that defines these types and functions:
///
///     kName             in commands, files and messages
///     Request           the request for a calibration
///     Options           of the acquisition, from the configuration: options(Config)
///     Acquisition       takes snapshots: begin, take, tick, phase, reason, progress, points;
///                       next and take_notes where the operator is guided
///     Run               the acquired data: run_of(Acquisition); its member `observed` has the times
///                       of the first and the last observation
///     Candidate         a judged model: its member `verdict` has the judgement
///     needs(Config)     which devices it reads
///     to_json(Request), request_from(json, Config*)
///     check(Request, Config), acquire(Request, Options)
///     identify(Run, Config, active, watch), inputs_of(Run), document_of(Candidate, ...)
///
/// Everything here is resolved at compile time.

#include <array>
#include <concepts>
#include <cstddef>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>
#include <variant>

namespace abbe::daemon {

/// Devices whose samples a method uses in a run.
struct MethodNeeds {
  bool tracker = false;
  bool axis_readings = true;  ///< false: each touch contains the position of the axes
};

template <class M, class Part>
concept HasPart =
    std::same_as<Part, typename M::Request> || std::same_as<Part, typename M::Acquisition> ||
    std::same_as<Part, typename M::Run> || std::same_as<Part, typename M::Candidate>;

template <class Part, class M, class... Others>
consteval auto method_with_part() {
  if constexpr (HasPart<M, Part>) {
    return M{};
  } else {
    return method_with_part<Part, Others...>();
  }
}

template <class... M>
struct MethodList {
  /// Number of methods that have this part.
  template <class Part>
  static constexpr int kOwners = (int{HasPart<M, Part>} + ...);
  static_assert(((kOwners<typename M::Request> == 1) && ...) &&
                    ((kOwners<typename M::Acquisition> == 1) && ...) &&
                    ((kOwners<typename M::Run> == 1) && ...) &&
                    ((kOwners<typename M::Candidate> == 1) && ...),
                "each method needs types of its own");

  using Request = std::variant<typename M::Request...>;
  using Options = std::tuple<typename M::Options...>;
  using Acquisition = std::variant<typename M::Acquisition...>;
  using Run = std::variant<typename M::Run...>;
  using Candidate = std::variant<typename M::Candidate...>;

  static constexpr std::array<std::string_view, sizeof...(M)> kNames{M::kName...};

  template <class Configuration>
  [[nodiscard]] static Options options(const Configuration& config) {
    return {M::options(config)...};
  }
  /// Calls act(method) for each method.
  template <class Act>
  static void for_each(Act&& act) {
    (act(M{}), ...);
  }
  /// Returns act(method, part) for the Request, Acquisition, Run or Candidate that `parts` holds.
  template <class Parts, class Act>
  static auto visit(Parts&& parts, Act&& act) {
    return std::visit(
        [&act](auto&& part) {
          using Part = std::remove_cvref_t<decltype(part)>;
          return act(method_with_part<Part, M...>(), std::forward<decltype(part)>(part));
        },
        std::forward<Parts>(parts));
  }
};

}  // namespace abbe::daemon
