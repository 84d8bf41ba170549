#pragma once
/// The error model of one machine as a subscriber received it, and the decision whether it may be
/// applied by the rule in abbe_v1.idl. Pure; used by one thread. Lengths in m.

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
  /// Time for which a vector may be applied, counted from now. After this time the vector is older
  /// than its validity.
  std::chrono::nanoseconds valid_for{0};
};

class ReceivedModel {
 public:
  void state(v1::ModelState state);
  void model(v1::ErrorModel model) { model_ = std::move(model); }
  /// Keeps the slice under the id of its model. Slices of several models are kept at the same time:
  /// slices of the next model arrive before its ModelState, and a late joiner may also receive
  /// slices of an old model.
  void slice(v1::ErrorGrid slice);

  [[nodiscard]] const std::optional<v1::ModelState>& state() const noexcept { return state_; }
  [[nodiscard]] const std::optional<v1::ErrorModel>& model() const noexcept { return model_; }

  /// All nodes of the model that ModelState names, in the order of the slices; nullopt while a
  /// slice is missing.
  [[nodiscard]] std::optional<std::vector<v1::GridNode>> grid() const;

  /// Number of nodes in the slices that are kept, over all models.
  [[nodiscard]] std::size_t kept_nodes() const;

  /// Whether the received grid may be applied. `publisher_alive`: the writer of ModelState has not
  /// lost its liveliness.
  [[nodiscard]] Decision decide(bool publisher_alive) const;

 private:
  std::optional<v1::ModelState> state_;
  std::optional<v1::ErrorModel> model_;
  using Slices = std::map<std::uint32_t, v1::ErrorGrid>;
  std::map<std::string, Slices> slices_;  // the slices, by model id
};

/// Whether this compensation vector may be applied. `delay`: the transit delay from Delay::of();
/// nullopt while the delay is not known.
[[nodiscard]] Decision decide(const v1::Compensation& compensation,
                              std::optional<std::chrono::nanoseconds> delay,
                              const std::optional<v1::ModelState>& state, bool publisher_alive);

/// The transit delay of the vectors from one publisher: how much longer a vector took, in the
/// network or in the socket of a suspended subscriber, than the fastest vector so far. The clocks
/// of publisher and subscriber may have any offset, and drift against each other by up to 1/kDrift.
class Delay {
 public:
  using Instant = std::chrono::steady_clock::time_point;
  static constexpr int kDrift = 5000;  ///< 1 part in 5000, 200 ppm

  /// The shortest transit time is regarded as known once vectors have arrived for this long.
  static constexpr std::chrono::milliseconds kFirst{200};

  /// The delay of `vector`. nullopt during the first kFirst, because all vectors since the start
  /// may have been delayed.
  [[nodiscard]] std::optional<std::chrono::nanoseconds> of(const v1::Compensation& vector,
                                                           Instant now);

  /// The initial estimate for the next publisher, which may have the same clock as this one, for
  /// example after a restart of abbe-dds. With the same clock the sum of clock offset and shortest
  /// transit time stays valid. If the first vector of the next publisher gives a sum that differs
  /// by more than kSameClock, that publisher has another clock and the estimate starts again.
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
