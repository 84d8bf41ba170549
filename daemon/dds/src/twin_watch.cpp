#include "abbe/dds/twin_watch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <utility>

#include "abbe/messages/cdr.hpp"

namespace abbe::dds {
namespace {

/// Other publishers that are remembered; a stranger may make up more.
constexpr std::size_t kMostClaims = 64;

/// For people: without what would change a terminal or a log.
std::string printable(std::string text) {
  std::ranges::replace_if(
      text, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }, '?');
  return text;
}

}  // namespace

TwinWatch::TwinWatch(Participant& participant) {
  const auto& own = participant.get().guid().guidPrefix.value;
  std::copy_n(std::begin(own), self_.size(), self_.begin());
  if (auto readers = Readers::create(participant, std::array{daemon::Topic::Identity}))
    readers_.emplace(std::move(*readers));
}

std::string TwinWatch::cycle(std::span<const std::byte> own, Instant now) {
  if (!readers_ || now < next_) return seen_;
  next_ = now + kPeriod;
  readers_->take([&](const Arrival& arrival) { take(arrival, now); });
  std::erase_if(claims_, [now](const auto& c) { return now - c.second.last > kGone; });

  seen_.clear();
  const auto identity = daemon::decode<v1::Identity>(own);
  if (!identity) return seen_;
  for (const auto& [id, claim] : claims_) {
    const bool same_name = claim.machine == identity->machine();
    const bool same_id = !claim.machine_id.empty() && claim.machine_id == identity->machine_id();
    if (!same_name && !same_id) continue;
    seen_ = same_id ? fmt::format("the same machine_id, as machine {},", printable(claim.machine))
                    : fmt::format("the same name, machine_id {},", printable(claim.machine_id));
    seen_ += " from DDS participant " + text_of(id);
    break;
  }
  return seen_;
}

void TwinWatch::take(const Arrival& arrival, Instant now) {
  const auto from = participant_of(arrival.writer);
  const auto identity = daemon::decode<v1::Identity>(arrival.payload);
  if (!identity || from == self_) return;
  if (claims_.size() >= kMostClaims && !claims_.contains(from)) return;
  claims_[from] = {identity->machine(), identity->machine_id(), now};
}

}  // namespace abbe::dds
