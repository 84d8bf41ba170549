#pragma once
/// The marks of one scale as they are crossed, up to a datum: four consecutive ones in one
/// direction whose decodings agree. Any fault begins the four anew; too many in a row say that the
/// scale is another one. Ordinary world, no allocation; one thread.

#include <array>
#include <cstdint>
#include <optional>
#include <tl/expected.hpp>

#include "abbe/drivers/sampling/distance_code.hpp"

namespace abbe::drivers {

struct MarkTraverseOptions {
  DistanceCode code;
  double counts_per_period = 4.0;  ///< negative: the counter runs against the scale
  /// going back by this much is a change of direction, less is noise
  double reversal_periods = 0.5;
  std::size_t most_refusals = 4;  ///< fours refused in a row, none of them by a reversal
};

class MarkTraverse {
 public:
  explicit MarkTraverse(const MarkTraverseOptions& options) noexcept : options_(options) {}

  /// The live counter, as often as it is known; at least about once a period of the scale.
  void on_position(std::int64_t count) noexcept;
  /// The counter at a mark that was just crossed. A datum, why these marks give none, or nothing
  /// yet.
  [[nodiscard]] std::optional<tl::expected<MarkDatum, MarkFault>> on_mark(
      std::int64_t count) noexcept;
  void reset() noexcept;

  [[nodiscard]] std::size_t marks() const noexcept { return count_; }
  [[nodiscard]] const MarkTraverseOptions& options() const noexcept { return options_; }

 private:
  void follow(double position) noexcept;
  void keep(double position) noexcept;
  [[nodiscard]] tl::unexpected<MarkFault> refuse(MarkFault fault) noexcept;

  MarkTraverseOptions options_;
  std::array<double, kMarksForDatum> marks_{};  ///< oldest first
  std::size_t count_ = 0;
  std::size_t refusals_ = 0;
  bool moving_ = false;  ///< positions are known
  int direction_ = 0;    ///< of travel; 0: not known yet
  double farthest_ = 0.0;
  bool reversed_ = false;  ///< since the latest mark
};

}  // namespace abbe::drivers
