#include "abbe/subscriber/internal/fragment_reassembly.hpp"

#include <algorithm>
#include <utility>

#include "rtps_fields.hpp"

namespace abbe::dds {
namespace {

using namespace rtps_message;

constexpr std::size_t kDataBytes = 20;  // length of a DATA submessage before its payload
constexpr std::size_t kSamplePayloadAt = kHeaderBytes + kSubmessageHeaderBytes + kDataBytes;

/// The message up to the payload, with space for the payload.
std::vector<std::uint8_t> message_for(const Fragment& fragment) {
  std::vector<std::uint8_t> message(kSamplePayloadAt + fragment.sample_size);
  std::ranges::copy(fragment.header, message.begin());
  message[kHeaderBytes] = kData;
  message[kHeaderBytes + 1] =
      static_cast<std::uint8_t>(kWithData | (fragment.little_endian ? kLittleEndian : 0));
  FieldReader<std::uint8_t> fields(message, fragment.little_endian);
  constexpr std::uint16_t kToInlineQos = kDataBytes - 4;
  fields.put_u16(kHeaderBytes + 2, static_cast<std::uint16_t>(kDataBytes + fragment.sample_size));
  fields.put_u16(kHeaderBytes + kSubmessageHeaderBytes + 2, kToInlineQos);
  std::ranges::copy(fragment.ids, message.begin() + static_cast<std::ptrdiff_t>(
                                                        kSamplePayloadAt - fragment.ids.size()));
  return message;
}

}  // namespace

FragmentReassembly::Sample* FragmentReassembly::sample_of(const Fragment& fragment) {
  const auto source = std::span(fragment.header).subspan<kPrefixAt, kPrefixBytes>();
  const auto known = std::ranges::find_if(incomplete_, [&](const Sample& sample) {
    return std::ranges::equal(sample.source, source) &&
           std::ranges::equal(sample.ids, fragment.ids) && sample.fragment_size == fragment.size &&
           sample.message.size() == kSamplePayloadAt + fragment.sample_size;
  });
  if (known != incomplete_.end()) return &*known;

  Sample sample{};
  std::ranges::copy(source, sample.source.begin());
  std::ranges::copy(fragment.ids, sample.ids.begin());
  sample.fragment_size = fragment.size;
  sample.message = message_for(fragment);
  sample.missing = (fragment.sample_size + fragment.size - 1) / fragment.size;
  sample.received.resize(sample.missing);
  if (incomplete_.size() == kMostSamples) incomplete_.pop_front();
  return &incomplete_.emplace_back(std::move(sample));
}

std::optional<std::vector<std::uint8_t>> FragmentReassembly::add(const Fragment& fragment) {
  if (fragment.sample_size > kLongestSample) return std::nullopt;
  const std::size_t begin = std::size_t{fragment.first - 1} * fragment.size;
  const std::size_t length = std::min<std::size_t>(std::size_t{fragment.count} * fragment.size,
                                                   fragment.sample_size - begin);
  if (fragment.payload.size() < length) return std::nullopt;

  const std::lock_guard lock(mutex_);
  Sample& sample = *sample_of(fragment);
  std::copy_n(fragment.payload.begin(), length,
              sample.message.begin() + static_cast<std::ptrdiff_t>(kSamplePayloadAt + begin));
  for (std::size_t i = fragment.first - 1; i < fragment.first - 1 + fragment.count; ++i) {
    if (sample.received[i]) continue;
    sample.received[i] = true;
    --sample.missing;
  }
  if (sample.missing > 0) return std::nullopt;
  auto message = std::move(sample.message);
  incomplete_.erase(
      std::ranges::find_if(incomplete_, [&](const Sample& s) { return &s == &sample; }));
  return message;
}

}  // namespace abbe::dds
