#pragma once
/// The one encoding: the types of abbe_v1.idl as the bytes that are recorded in MCAP, cross the
/// local socket to abbe-dds and go on the DDS wire. A payload is the encapsulation header 00 01 00
/// 00 and XCDR1 little endian [DDSI-RTPS 2.5, 10.2; DDS-XTypes 1.3, 7.4.1]. Fast CDR checks no
/// bound of the IDL, so both directions do it here. T is any struct of abbe::v1 that has a topic;
/// other types do not link. Pure, thread-safe; allocates.

#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe_v1.h"  // generated from protocol/idl/abbe_v1.idl

namespace abbe::daemon {

/// Replaces the content of `payload` (its capacity is kept, so reuse one buffer). Error (BadInput,
/// `payload` empty): a string or sequence beyond its bound, a string with a NUL inside, an
/// enumerator that does not exist.
template <class T>
[[nodiscard]] Result<void> encode(const T& value, std::vector<std::byte>& payload);

/// Total: any bytes give a value or an Error (BadInput). At most 3 bytes of padding may follow the
/// value.
template <class T>
[[nodiscard]] Result<T> decode(std::span<const std::byte> payload);

/// Fully qualified name as DDS and MCAP schemas use it: "abbe::v1::Snapshot".
template <class T>
[[nodiscard]] std::string_view type_name() noexcept;

/// Name of the DDS topic and MCAP channel: "abbe/v1/Snapshot". The version in it changes with any
/// change of the type.
template <class T>
[[nodiscard]] std::string_view topic_name() noexcept;

/// The text of abbe_v1.idl as it was at build, for MCAP schemas of encoding "omgidl".
[[nodiscard]] std::string_view idl_text() noexcept;

/// What the IDL bounds in T itself (nested structs have their own): member and bound, in the order
/// of the IDL.
struct MemberBound {
  std::string_view member;
  std::size_t bound;
};
template <class T>
[[nodiscard]] std::span<const MemberBound> member_bounds() noexcept;

}  // namespace abbe::daemon
