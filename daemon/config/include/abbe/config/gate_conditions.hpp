#pragma once
/// What a person can accept although the gate would refuse the model for it.

#include <span>
#include <string_view>

namespace abbe::daemon {

/// The names that [gate] accept may have.
[[nodiscard]] std::span<const std::string_view> gate_conditions() noexcept;

}  // namespace abbe::daemon
