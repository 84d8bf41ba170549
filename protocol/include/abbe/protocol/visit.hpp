#pragma once
/// Replacement of std::visit for variants of trivially copyable alternatives. Such variants are
/// never valueless, so no exception is possible, and the object code contains no throw. Usable on
/// the real-time path if the visitor is.

#include <cstddef>
#include <type_traits>
#include <utility>
#include <variant>

#include "abbe/protocol/rt.hpp"

namespace abbe::protocol {

/// Calls visitor(alternative). The visitor must return the same type for all alternatives.
template <std::size_t kFrom = 0, class Visitor, class... Alternatives>
constexpr auto visit_trivial(const Visitor& visitor,
                             const std::variant<Alternatives...>& variant) ABBE_RT {
  static_assert((std::is_trivially_copyable_v<Alternatives> && ...));
  if constexpr (kFrom + 1 == sizeof...(Alternatives)) {
    return visitor(*std::get_if<kFrom>(&variant));
  } else {
    if (const auto* alternative = std::get_if<kFrom>(&variant)) return visitor(*alternative);
    return visit_trivial<kFrom + 1>(visitor, variant);
  }
}

}  // namespace abbe::protocol
