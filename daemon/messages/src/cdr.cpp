#include "abbe/messages/cdr.hpp"

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>

#include <cstring>
#include <exception>
#include <string>

#include "abbe/messages/topics.hpp"
#include "cdr_bounds.hpp"

namespace abbe::daemon {
namespace {

constexpr std::size_t kMaxPaddingBytes = 3;

template <class T>
struct Names;  // one specialisation per topic, at the end of the file

template <class T>
std::string broken_bound(const T& value) {
  bounds::Checker checker;
  bounds::visit(value, checker);
  return checker.broken;
}

template <class T>
tl::unexpected<Error> refuse(const char* what, const std::string& why) {
  return fail(ErrorCode::BadInput,
              std::string(what) + " " + std::string(Names<T>::type) + ": " + why);
}

eprosima::fastcdr::Cdr little_endian_cdr(eprosima::fastcdr::FastBuffer& buffer) {
  return {buffer, eprosima::fastcdr::Cdr::LITTLE_ENDIANNESS, eprosima::fastcdr::Cdr::DDS_CDR};
}

}  // namespace

template <class T>
Result<void> encode(const T& value, std::vector<std::byte>& payload) {
  payload.clear();
  if (const std::string broken = broken_bound(value); !broken.empty())
    return refuse<T>("encode", broken);
  payload.resize(kCdrHeaderBytes + T::getCdrSerializedSize(value));

  try {
    eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char*>(payload.data()), payload.size());
    auto cdr = little_endian_cdr(buffer);
    cdr.serialize_encapsulation();
    value.serialize(cdr);
    payload.resize(cdr.getSerializedDataLength());
  } catch (const std::exception& e) {
    payload.clear();
    return refuse<T>("encode", e.what());
  }

  return {};
}

template <class T>
Result<T> decode(std::span<const std::byte> payload) {
  if (payload.size() < kCdrHeaderBytes)
    return refuse<T>("decode", std::to_string(payload.size()) + " bytes, shorter than the header");
  if (payload[0] != std::byte{0} || payload[1] != std::byte{1}) {
    return refuse<T>("decode", "encapsulation is not CDR_LE (00 01)");
  }

  T value;
  try {
    // Fast CDR only has an interface for writable buffers, but does not write to a buffer that it
    // decodes.
    auto* bytes = const_cast<char*>(reinterpret_cast<const char*>(payload.data()));
    eprosima::fastcdr::FastBuffer buffer(bytes, payload.size());
    auto cdr = little_endian_cdr(buffer);
    cdr.read_encapsulation();
    value.deserialize(cdr);
    if (const std::size_t used = cdr.getSerializedDataLength();
        payload.size() - used > kMaxPaddingBytes) {
      return refuse<T>("decode", std::to_string(payload.size() - used) + " bytes after the value");
    }
  } catch (const std::exception& e) {
    return refuse<T>("decode", e.what());
  }

  if (const std::string broken = broken_bound(value); !broken.empty())
    return refuse<T>("decode", broken);
  return value;
}

template <class T>
std::string_view type_name() noexcept {
  return Names<T>::type;
}

template <class T>
std::string_view topic_name() noexcept {
  return Names<T>::topic;
}

template <class T>
std::span<const MemberBound> member_bounds() noexcept {
  static const std::vector<MemberBound> collected = [] {
    std::vector<MemberBound> bounds;
    const auto collect = [&]<class... Bound>(std::string_view member, const auto&, Bound... bound) {
      if constexpr (sizeof...(bound) == 1)
        bounds.push_back({member, static_cast<std::size_t>(bound)...});
    };
    bounds::visit(T{}, collect);
    return bounds;
  }();
  return collected;
}

template std::span<const MemberBound> member_bounds<v1::Parameter>() noexcept;
template std::span<const MemberBound> member_bounds<v1::AxisRange>() noexcept;

#define ABBE_TOPIC_TYPE(TYPE)                                             \
  namespace {                                                             \
  template <>                                                             \
  struct Names<v1::TYPE> {                                                \
    static constexpr std::string_view type = "abbe::v1::" #TYPE;          \
    static constexpr std::string_view topic = "abbe/v1/" #TYPE;           \
  };                                                                      \
  }                                                                       \
  template Result<void> encode(const v1::TYPE&, std::vector<std::byte>&); \
  template Result<v1::TYPE> decode<v1::TYPE>(std::span<const std::byte>); \
  template std::string_view type_name<v1::TYPE>() noexcept;               \
  template std::string_view topic_name<v1::TYPE>() noexcept;              \
  template std::span<const MemberBound> member_bounds<v1::TYPE>() noexcept;

ABBE_TOPIC_TYPE(TrackerPoint)
ABBE_TOPIC_TYPE(AxisSample)
ABBE_TOPIC_TYPE(ProbeTrigger)
ABBE_TOPIC_TYPE(TouchScan)
ABBE_TOPIC_TYPE(EnvironmentSample)
ABBE_TOPIC_TYPE(RawBytes)
ABBE_TOPIC_TYPE(CalibrationEvent)
ABBE_TOPIC_TYPE(Snapshot)
ABBE_TOPIC_TYPE(Compensation)
ABBE_TOPIC_TYPE(ErrorModel)
ABBE_TOPIC_TYPE(ErrorGrid)
ABBE_TOPIC_TYPE(ModelState)
ABBE_TOPIC_TYPE(Health)
ABBE_TOPIC_TYPE(Identity)

#undef ABBE_TOPIC_TYPE

}  // namespace abbe::daemon
