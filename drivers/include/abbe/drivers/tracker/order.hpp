#pragma once
/// What a person asks of a tracker while abbe uses it. All but ListReflectors move the beam or end
/// the distance it holds, so the measurement is stopped before and started after. Ordinary world.

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace abbe::drivers {

/// emScon has room for 32 UTF-16 units, each at most 3 bytes of UTF-8.
inline constexpr std::size_t kLongestReflectorName = 96;
/// Beyond the reach of every tracker: a distance in the wrong unit is refused, not searched for.
inline constexpr double kLongestSearch_m = 200.0;

struct TrackerOrder {
  enum class What {
    Initialize,      ///< drives the motors and drops the beam
    ListReflectors,  ///< of the controller's list
    SetReflector,
    GoHome,         ///< to the bird bath: the home position of the reflector
    FindReflector,  ///< searches around where the beam points
  };
  What what = What::ListReflectors;
  std::uint64_t number = 0;  ///< comes back in the report
  std::string reflector;     ///< SetReflector: name or id
  /// FindReflector: about how far away the reflector is; 0 to kLongestSearch_m
  double distance_m = 0.0;
};
/// A literal: "initialize", "find", ...
[[nodiscard]] const char* name_of(TrackerOrder::What) noexcept;

struct TrackerReflector {
  std::int32_t id = 0;
  std::string name;
  bool in_use = false;
};

/// One for each order.
struct TrackerOrderReport {
  enum class Outcome {
    Done,
    Refused,  ///< by the controller, or because of the state the session is in
    Failed,   ///< no answer, or the connection was lost: what came of it is not known
  };
  std::uint64_t number = 0;
  Outcome outcome = Outcome::Failed;
  std::string text;                          ///< what came of it
  std::vector<TrackerReflector> reflectors;  ///< ListReflectors
  [[nodiscard]] bool done() const noexcept { return outcome == Outcome::Done; }
};

}  // namespace abbe::drivers
