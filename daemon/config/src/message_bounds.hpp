#pragma once
/// Checks names that are published and recorded in messages with bounded strings (abbe_v1.idl).
/// They are checked when the configuration is read, because a name that is too long would make
/// every message that contains it invalid.

#include <cstddef>
#include <string>
#include <string_view>

#include "abbe/messages/cdr.hpp"
#include "classified_section.hpp"

namespace abbe::daemon {

/// The largest size that the IDL allows for `member` of T (a string or sequence). 0 if T has no
/// such member, which means that the caller misspelt the name.
template <class T>
[[nodiscard]] std::size_t bound_of(std::string_view member) {
  for (const auto& known : member_bounds<T>())
    if (known.member == member) return known.bound;
  return 0;
}

/// Reads a text that is published in messages. Adds a fault if it is longer than `most_bytes` or
/// contains a NUL.
inline bool get_bounded(ClassifiedSection& section, Key key, std::string& out,
                        std::size_t most_bytes, Need need = Need::Optional) {
  if (!section.get(key, out, need)) return false;
  if (out.size() > most_bytes)
    section.fault(key.name, "must be at most " + std::to_string(most_bytes) +
                                " bytes long, to fit into the published messages");
  if (out.find('\0') != std::string::npos) section.fault(key.name, "contains a NUL");
  return true;
}

}  // namespace abbe::daemon
