#pragma once
/// What goes out and is recorded in messages of bounded size (abbe_v1.idl) must fit from the start:
/// a name too long would lose every message that carries it, a thousand times a second and for
/// ever.

#include <cstddef>
#include <string>
#include <string_view>

#include "abbe/config/section.hpp"
#include "abbe/messages/cdr.hpp"

namespace abbe::daemon {

/// The IDL's bound of a member of T; the member is there, or the name is misspelt here.
template <class T>
[[nodiscard]] std::size_t bound_of(std::string_view member) {
  for (const auto& known : member_bounds<T>())
    if (known.member == member) return known.bound;
  return 0;
}

/// A text that travels in messages: faults one that is longer than `most_bytes` or has a NUL
/// inside.
inline bool get_bounded(Section& section, std::string_view key, std::string& out,
                        std::size_t most_bytes, Need need = Need::Optional) {
  if (!section.get(key, out, need)) return false;
  if (out.size() > most_bytes)
    section.fault(key, "must be at most " + std::to_string(most_bytes) +
                           " bytes long: it travels in messages of bounded size");
  if (out.find('\0') != std::string::npos) section.fault(key, "has a NUL inside");
  return true;
}

}  // namespace abbe::daemon
