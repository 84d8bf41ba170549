#include "abbe/dds/fragment_joiner.hpp"

#include <algorithm>
#include <utility>

#include "rtps_fields.hpp"

namespace abbe::dds {
namespace {

using namespace rtps_message;

constexpr std::size_t kDataBytes = 20;  // of a DATA submessage before its payload
constexpr std::size_t kJoinedPayloadAt = kHeaderBytes + kSubmessageHeaderBytes + kDataBytes;

/// The message up to the payload, and room for the payload.
std::vector<std::uint8_t> message_for(const Fragment& fragment) {
  std::vector<std::uint8_t> message(kJoinedPayloadAt + fragment.sample_size);
  std::ranges::copy(fragment.header, message.begin());
  message[kHeaderBytes] = kData;
  message[kHeaderBytes + 1] =
      static_cast<std::uint8_t>(kWithData | (fragment.little_endian ? kLittleEndian : 0));
  FieldReader fields(std::span(message), fragment.little_endian);
  constexpr std::uint16_t kToInlineQos = kDataBytes - 4;
  fields.put_u16(kHeaderBytes + 2, static_cast<std::uint16_t>(kDataBytes + fragment.sample_size));
  fields.put_u16(kHeaderBytes + kSubmessageHeaderBytes + 2, kToInlineQos);
  std::ranges::copy(fragment.ids, message.begin() + static_cast<std::ptrdiff_t>(
                                                        kJoinedPayloadAt - fragment.ids.size()));
  return message;
}

}  // namespace

FragmentJoiner::Sample* FragmentJoiner::sample_of(const Fragment& fragment) {
  const auto source = std::span(fragment.header).subspan<kPrefixAt, kPrefixBytes>();
  const auto known = std::ranges::find_if(begun_, [&](const Sample& sample) {
    return std::ranges::equal(sample.source, source) &&
           std::ranges::equal(sample.ids, fragment.ids) && sample.fragment_size == fragment.size &&
           sample.message.size() == kJoinedPayloadAt + fragment.sample_size;
  });
  if (known != begun_.end()) return &*known;

  Sample sample{};
  std::ranges::copy(source, sample.source.begin());
  std::ranges::copy(fragment.ids, sample.ids.begin());
  sample.fragment_size = fragment.size;
  sample.message = message_for(fragment);
  sample.missing = (fragment.sample_size + fragment.size - 1) / fragment.size;
  sample.is_here.resize(sample.missing);
  if (begun_.size() == kMostSamples) begun_.pop_front();
  return &begun_.emplace_back(std::move(sample));
}

void FragmentJoiner::add(const Fragment& fragment) {
  if (fragment.sample_size > kLongestSample) return;
  const std::lock_guard lock(mutex_);
  Sample& sample = *sample_of(fragment);
  const std::size_t begin = std::size_t{fragment.first - 1} * fragment.size;
  const std::size_t length = std::min<std::size_t>(std::size_t{fragment.count} * fragment.size,
                                                   fragment.sample_size - begin);
  if (fragment.payload.size() < length) return;
  std::copy_n(fragment.payload.begin(), length,
              sample.message.begin() + static_cast<std::ptrdiff_t>(kJoinedPayloadAt + begin));

  for (std::size_t i = fragment.first - 1; i < fragment.first - 1 + fragment.count; ++i) {
    if (sample.is_here[i]) continue;
    sample.is_here[i] = true;
    --sample.missing;
  }
  if (sample.missing > 0) return;
  if (whole_.size() < kMostSamples) whole_.push_back(std::move(sample.message));
  begun_.erase(std::ranges::find_if(begun_, [&](const Sample& s) { return &s == &sample; }));
}

std::optional<std::vector<std::uint8_t>> FragmentJoiner::take() {
  const std::lock_guard lock(mutex_);
  if (whole_.empty()) return std::nullopt;
  auto message = std::move(whole_.front());
  whole_.pop_front();
  return message;
}

}  // namespace abbe::dds
