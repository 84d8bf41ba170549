#pragma once
/// std::visit for variants of trivially copyable alternatives. These are never valueless, so
/// nothing can be thrown, and neither the object file nor a checker has to take that on trust.
/// Usable on the real-time path if the visitor is.

#include <cstddef>
#include <type_traits>
#include <utility>
#include <variant>

#include "abbe/protocol/rt.hpp"

namespace abbe::protocol {

/// Calls visitor(alternative); all alternatives must give the same type.
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
