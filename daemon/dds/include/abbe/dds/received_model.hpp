#pragma once
/// What one machine has told a subscriber about its errors, and whether it may be applied by the
/// rule of abbe_v1.idl. Pure; used by one thread. SI: m.

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

/// Apply or not, and why not.
struct Decision {
  bool apply = false;
  std::string reason;  ///< "ACTIVE" if applied
};

class ReceivedModel {
 public:
  void state(v1::ModelState state);
  void model(v1::ErrorModel model) { model_ = std::move(model); }
  /// Slices are kept by model: those of the next one come before its state, and a late joiner may
  /// meet old ones among them.
  void slice(v1::ErrorGrid slice);

  [[nodiscard]] const std::optional<v1::ModelState>& state() const noexcept { return state_; }
  [[nodiscard]] const std::optional<v1::ErrorModel>& model() const noexcept { return model_; }

  /// All nodes of the state's model in the order of the slices; nothing while a slice is missing.
  [[nodiscard]] std::optional<std::vector<v1::GridNode>> grid() const;

  /// May the grid be applied? `publisher_alive`: the writer of the state keeps its lease.
  [[nodiscard]] Decision decide(bool publisher_alive) const;

 private:
  std::optional<v1::ModelState> state_;
  std::optional<v1::ErrorModel> model_;
  using Slices = std::map<std::uint32_t, v1::ErrorGrid>;
  std::map<std::string, Slices> slices_;  // by model
};

/// May this vector be applied, that was published `waited` ago? Nothing: that is not known yet.
[[nodiscard]] Decision decide(const v1::Compensation& compensation,
                              std::optional<std::chrono::nanoseconds> waited,
                              const std::optional<v1::ModelState>& state, bool publisher_alive);

/// How much longer the vectors of one publisher were on their way than the quickest of them: in the
/// network, in a socket while this process stood still. The two clocks need not agree; they may
/// drift apart by kDrift.
class Delay {
 public:
  using Instant = std::chrono::steady_clock::time_point;
  static constexpr int kDrift = 5000;  ///< one part in so many, 200 ppm

  static constexpr std::chrono::milliseconds kFirst{200};  ///< shows how quick the way can be

  /// Nothing until then: the first vectors may all have waited.
  [[nodiscard]] std::optional<std::chrono::nanoseconds> of(const v1::Compensation& vector,
                                                           Instant now);

  /// For the publisher that comes after this one, which may have the same clock: abbe-dds after a
  /// restart. Then what is known holds on; a first vector farther than kSameClock from it shows
  /// another clock.
  [[nodiscard]] Delay for_next_publisher() const;
  static constexpr std::chrono::milliseconds kSameClock{20};

 private:
  bool inherited_ = false;
  std::optional<Instant> first_;
  std::optional<std::chrono::nanoseconds>
      least_;  ///< from the publisher's clock to ours, and the way
  Instant last_{};
};

[[nodiscard]] const char* name_of(v1::ModelStatus status) noexcept;  ///< "ACTIVE"

}  // namespace abbe::dds
