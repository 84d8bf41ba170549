#pragma once
/// Collects the reference marks of one scale as they are crossed, until they give a zero (the
/// scale's zero relative to the counter): four consecutive marks, crossed in one direction, whose
/// decodings agree. After a fault four new marks are needed; too many consecutive refusals mean
/// that the scale is not the configured one. Not for the RT path, but no allocation; one thread.

#include <array>
#include <cstdint>
#include <optional>
#include <tl/expected.hpp>

#include "abbe/drivers/sampling/distance_code.hpp"

namespace abbe::drivers {

struct MarkTraverseOptions {
  DistanceCode code;
  double counts_per_period = 4.0;  ///< negative: the counter counts against the scale
  /// Smallest motion backwards that counts as a change of direction; a smaller motion is noise.
  double reversal_periods = 0.5;
  std::size_t most_refusals = 4;  ///< consecutive refusals; reversals are not counted
};

class MarkTraverse {
 public:
  explicit MarkTraverse(const MarkTraverseOptions& options) noexcept : options_(options) {}

  /// Takes the live count. Call it at least about once per signal period of the scale.
  void on_position(std::int64_t count) noexcept;
  /// Takes the count at a mark that was crossed. Returns a zero, the reason why the marks give
  /// none, or nullopt if more marks are needed.
  [[nodiscard]] std::optional<tl::expected<MarkZero, MarkFault>> on_mark(
      std::int64_t count) noexcept;
  void reset() noexcept;

  [[nodiscard]] std::size_t marks() const noexcept { return count_; }
  [[nodiscard]] const MarkTraverseOptions& options() const noexcept { return options_; }

 private:
  void follow(double position) noexcept;
  void keep(double position) noexcept;
  [[nodiscard]] tl::unexpected<MarkFault> refuse(MarkFault fault) noexcept;

  MarkTraverseOptions options_;
  std::array<double, kMarksForZero> marks_{};  ///< oldest first
  std::size_t count_ = 0;
  std::size_t refusals_ = 0;
  bool moving_ = false;  ///< a position is known
  int direction_ = 0;    ///< direction of travel; 0: unknown
  double farthest_ = 0.0;
  bool reversed_ = false;  ///< the direction has changed since the latest mark
};

}  // namespace abbe::drivers
