#pragma once
/// Orders of an operator to a tracker that abbe uses. All except ListReflectors move the beam or
/// interrupt the distance measurement, so abbe stops the measurement before the order and starts it
/// again afterwards. Not real-time.

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace abbe::drivers {

/// Longest name in bytes: an emScon name has at most 32 UTF-16 code units, each at most 3 bytes in
/// UTF-8.
inline constexpr std::size_t kLongestReflectorName = 96;
/// Largest search distance, above the range of every tracker. A larger one is refused: its unit is
/// probably wrong.
inline constexpr double kLongestSearch_m = 200.0;

struct TrackerOrder {
  enum class What {
    Initialize,      ///< moves the tracker head and loses the beam
    ListReflectors,  ///< reads the list of reflectors from the controller
    SetReflector,
    GoHome,         ///< points the beam to the bird bath, the home position of the reflector
    FindReflector,  ///< searches around the current direction of the beam
  };
  What what = What::ListReflectors;
  std::uint64_t number = 0;  ///< identifies the order in its report
  std::string reflector;     ///< for SetReflector: name or id
  /// For FindReflector: approximate distance of the reflector, 0 to kLongestSearch_m.
  double distance_m = 0.0;
};
/// Text for messages: "initialize", "find", ...
[[nodiscard]] const char* name_of(TrackerOrder::What) noexcept;

struct TrackerReflector {
  std::int32_t id = 0;
  std::string name;
  bool in_use = false;
};

/// Result of an order.
struct TrackerOrderReport {
  enum class Outcome {
    Done,
    Refused,  ///< the controller, or the state of the session, does not permit it
    Failed,   ///< no answer, or the connection was lost: the result is unknown
  };
  std::uint64_t number = 0;
  Outcome outcome = Outcome::Failed;
  std::string text;                          ///< the result in words
  std::vector<TrackerReflector> reflectors;  ///< for ListReflectors
  [[nodiscard]] bool done() const noexcept { return outcome == Outcome::Done; }
};

}  // namespace abbe::drivers
