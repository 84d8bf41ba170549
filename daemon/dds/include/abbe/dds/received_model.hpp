#pragma once
/// What one machine has told a subscriber about its errors, and whether it may be applied by the rule of
/// abbe_v1.idl. Pure; used by one thread. SI: m.

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "abbe/daemon/error.hpp"
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
  /// Slices are kept by model: those of the next one come before its state, and a late joiner may meet old
  /// ones among them.
  void slice(v1::ErrorGrid slice);

  [[nodiscard]] const std::optional<v1::ModelState>& state() const noexcept { return state_; }
  [[nodiscard]] const std::optional<v1::ErrorModel>& model() const noexcept { return model_; }

  /// All nodes of the state's model in the order of the slices; nothing while a slice is missing.
  [[nodiscard]] std::optional<std::vector<v1::GridNode>> grid() const;

  /// May the grid be applied? `answered_for`: a writer of ModelState keeps its lease.
  [[nodiscard]] Decision decide(bool answered_for) const;

 private:
  std::optional<v1::ModelState> state_;
  std::optional<v1::ErrorModel> model_;
  using Slices = std::map<std::uint32_t, v1::ErrorGrid>;
  std::map<std::string, Slices> slices_;  // by model
};

/// May this vector be applied, as it arrived just now?
[[nodiscard]] Decision decide(const v1::Compensation& compensation,
                              const std::optional<v1::ModelState>& state, bool answered_for);

[[nodiscard]] const char* name_of(v1::ModelStatus status) noexcept;  ///< "ACTIVE"

}  // namespace abbe::dds
