#pragma once
/// The encoding of the types of abbe_v1.idl. The same bytes are recorded in MCAP, sent over the
/// local socket to abbe-dds and sent over DDS. A payload consists of the encapsulation header
/// 00 01 00 00 and XCDR1 little endian [DDSI-RTPS 2.5, 10.2; DDS-XTypes 1.3, 7.4.1]. Fast CDR does
/// not check the bounds of the IDL; encode() and decode() do. T is any struct of abbe::v1 that has
/// a topic; other types do not link. Pure, thread-safe; allocates.

#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe_v1.h"  // generated from protocol/idl/abbe_v1.idl

namespace abbe::daemon {

/// Replaces the content of `payload` and keeps its capacity, so that one buffer can be reused.
/// Error BadInput, and `payload` empty: a string or sequence exceeds its bound, a string contains a
/// NUL, or an enumerator does not exist.
template <class T>
[[nodiscard]] Result<void> encode(const T& value, std::vector<std::byte>& payload);

/// Accepts any bytes: returns a value or Error BadInput. At most 3 bytes of padding may follow the
/// value.
template <class T>
[[nodiscard]] Result<T> decode(std::span<const std::byte> payload);

/// Fully qualified name of the type, as in DDS and in MCAP schemas: "abbe::v1::Snapshot".
template <class T>
[[nodiscard]] std::string_view type_name() noexcept;

/// Name of the DDS topic and MCAP channel: "abbe/v1/Snapshot". The name contains a version,
/// which is incremented with every change of the type.
template <class T>
[[nodiscard]] std::string_view topic_name() noexcept;

/// The text of abbe_v1.idl at build time, for MCAP schemas of encoding "omgidl".
[[nodiscard]] std::string_view idl_text() noexcept;

/// The bounded members of T and their bounds, in the order of the IDL. Members of nested structs
/// are not included.
struct MemberBound {
  std::string_view member;
  std::size_t bound;
};
template <class T>
[[nodiscard]] std::span<const MemberBound> member_bounds() noexcept;

}  // namespace abbe::daemon
