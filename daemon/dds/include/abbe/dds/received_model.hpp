#pragma once
/// The error model of one machine as a subscriber received it, and the decision whether it may be
/// applied by the rule of abbe_v1.idl. Pure; used by one thread. SI: m.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe_v1.h"

namespace abbe::dds {

/// Whether to apply the model, and the reason if not.
struct Decision {
  bool apply = false;
  std::string reason;  ///< "ACTIVE" if applied
};

class ReceivedModel {
 public:
  void state(v1::ModelState state);
  void model(v1::ErrorModel model) { model_ = std::move(model); }
  /// Keeps the slices by model: the slices of the next model arrive before its state, and a late
  /// joiner may receive slices of an old model among them.
  void slice(v1::ErrorGrid slice);

  [[nodiscard]] const std::optional<v1::ModelState>& state() const noexcept { return state_; }
  [[nodiscard]] const std::optional<v1::ErrorModel>& model() const noexcept { return model_; }

  /// All nodes of the model that ModelState names, in the order of the slices; nullopt while a
  /// slice is missing.
  [[nodiscard]] std::optional<std::vector<v1::GridNode>> grid() const;

  /// Whether the grid may be applied. `publisher_alive`: the writer of ModelState keeps its lease.
  [[nodiscard]] Decision decide(bool publisher_alive) const;

 private:
  std::optional<v1::ModelState> state_;
  std::optional<v1::ErrorModel> model_;
  using Slices = std::map<std::uint32_t, v1::ErrorGrid>;
  std::map<std::string, Slices> slices_;  // by model
};

/// Whether this vector may be applied. `delay`: from Delay::of(); nullopt while it is not known.
[[nodiscard]] Decision decide(const v1::Compensation& compensation,
                              std::optional<std::chrono::nanoseconds> delay,
                              const std::optional<v1::ModelState>& state, bool publisher_alive);

/// The transit time of the vectors of one publisher in excess of the shortest one: in the network,
/// or in the socket while this process was suspended. The clocks of publisher and subscriber may
/// have any offset, and drift against each other by up to kDrift.
class Delay {
 public:
  using Instant = std::chrono::steady_clock::time_point;
  static constexpr int kDrift = 5000;  ///< 1 part in 5000, 200 ppm

  /// The shortest transit time is regarded as known after this time.
  static constexpr std::chrono::milliseconds kFirst{200};

  /// nullopt during the first kFirst, because all of the first vectors may have been delayed.
  [[nodiscard]] std::optional<std::chrono::nanoseconds> of(const v1::Compensation& vector,
                                                           Instant now);

  /// The initial value for the publisher that follows this one and may have the same clock, for
  /// example abbe-dds after a restart. With the same clock the shortest transit time stays valid;
  /// if the offset of the first vector differs from it by more than kSameClock, the clock is
  /// another one and the estimate starts again.
  [[nodiscard]] Delay for_next_publisher() const;
  static constexpr std::chrono::milliseconds kSameClock{20};

 private:
  bool inherited_ = false;
  std::optional<Instant> first_;
  /// clock offset from publisher to subscriber plus the shortest transit time
  std::optional<std::chrono::nanoseconds> least_;
  Instant last_{};
};

[[nodiscard]] const char* name_of(v1::ModelStatus status) noexcept;  ///< "ACTIVE"

}  // namespace abbe::dds
