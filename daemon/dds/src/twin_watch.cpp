#include "abbe/dds/twin_watch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <tuple>
#include <utility>

#include "abbe/messages/cdr.hpp"

namespace abbe::dds {
namespace {

/// Most publishers of this name or identity that are stored, because other participants may publish
/// any number.
constexpr std::size_t kMostClaims = 64;
/// A publisher repeats its Identity every second; a claim older than this is no longer present.
constexpr std::chrono::milliseconds kRepeated{1500};

/// The text without characters that could change a terminal or a log.
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
  const auto identity = daemon::decode<v1::Identity>(own);
  readers_->take([&](const Arrival& arrival) {
    if (identity) take(arrival, *identity, now);
  });
  std::erase_if(claims_, [now](const auto& c) { return now - c.second.last > kGone; });
  seen_ = identity ? in_words(*identity) : std::string{};
  return seen_;
}

void TwinWatch::take(const Arrival& arrival, const v1::Identity& own, Instant now) {
  const auto from = participant_of(arrival.writer);
  const auto identity = daemon::decode<v1::Identity>(arrival.payload);
  if (!identity || from == self_) return;
  const Claim claim{.machine = identity->machine(),
                    .machine_id = identity->machine_id(),
                    .first = now,
                    .last = now};
  if (!is_twin(claim, own)) return;
  if (const auto known = claims_.find(from); known != claims_.end()) {
    const auto first = known->second.first;
    known->second = claim;
    known->second.first = first;
    return;
  }
  if (claims_.size() >= kMostClaims) {
    // Removes the publisher that was silent longest; a publisher that repeats its Identity keeps
    // its place.
    const auto quietest =
        std::ranges::min_element(claims_, {}, [](const auto& c) { return c.second.last; });
    if (now - quietest->second.last < kRepeated) return;
    claims_.erase(quietest);
  }
  claims_.emplace(from, claim);
}

bool TwinWatch::is_twin(const Claim& claim, const v1::Identity& own) {
  return claim.machine == own.machine() || has_id_of(claim, own);
}

bool TwinWatch::has_id_of(const Claim& claim, const v1::Identity& own) {
  return !claim.machine_id.empty() && claim.machine_id == own.machine_id();
}

/// The text about the twins. It names a copied identity before a copied name, and otherwise the
/// twin that was seen first, so that a participant that comes later does not hide it.
std::string TwinWatch::in_words(const v1::Identity& own) const {
  const std::pair<const ParticipantId, Claim>* shown = nullptr;
  std::size_t twins = 0;
  const auto rank = [&own](const Claim& c) {
    return std::tuple(!has_id_of(c, own), c.machine != own.machine(), c.first);
  };
  for (const auto& claim : claims_) {
    if (!is_twin(claim.second, own)) continue;
    ++twins;
    if (shown == nullptr || rank(claim.second) < rank(shown->second)) shown = &claim;
  }
  if (shown == nullptr) return {};
  const auto& [id, claim] = *shown;
  auto text = has_id_of(claim, own)
                  ? fmt::format("{}{},", kTwinOfSameId, printable(claim.machine))
                  : fmt::format("the same name, machine_id {},", printable(claim.machine_id));
  text += " from DDS participant " + text_of(id);
  if (twins > 1) text += fmt::format(" and {} more", twins - 1);
  return text;
}

}  // namespace abbe::dds
