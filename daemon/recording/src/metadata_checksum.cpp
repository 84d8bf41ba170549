#include "metadata_checksum.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>

#include "abbe/base/sha256.hpp"
#include "streams.hpp"

namespace abbe::daemon::recording {
namespace {

constexpr std::array kRecords{kRecordingMetadata, kConfigurationMetadata, kVersionsMetadata};

enum class Checked { Missing, Without, Right, Wrong };

Checked check(const std::map<std::string, MetadataEntries>& metadata, std::string_view record) {
  const auto entries = metadata.find(std::string{record});
  if (entries == metadata.end()) return Checked::Missing;
  const auto checksum = entries->second.find(kChecksum);
  if (checksum == entries->second.end()) return Checked::Without;
  return checksum->second == metadata_sha256(record, entries->second) ? Checked::Right
                                                                      : Checked::Wrong;
}

/// Compares the text of the configuration with its hash, the only checksum in recordings of older
/// versions.
MetadataCheck check_text(const MetadataEntries& configuration) {
  const auto text = configuration.find("text"), hash = configuration.find("sha256");
  if (text == configuration.end() || hash == configuration.end()) return MetadataCheck::Unchecked;
  return hash->second == sha256_hex(text->second) ? MetadataCheck::Right : MetadataCheck::Damaged;
}

}  // namespace

std::string metadata_sha256(std::string_view record, const MetadataEntries& entries) {
  Sha256 hash;
  const auto add = [&hash](std::string_view text) {
    hash.update_bytes_of(static_cast<std::uint64_t>(text.size()));
    hash.update(text);
  };
  add(record);
  for (const auto& [name, value] : entries) {
    if (name == kChecksum) continue;
    add(name);
    add(value);
  }
  return hash.hex();
}

MetadataJudgement judge_metadata(const std::map<std::string, MetadataEntries>& metadata) {
  // The recording has checksums if any record has one: a single damaged bit can hide one checksum
  // or one record, but not all three.
  const bool checked = std::ranges::any_of(kRecords, [&](std::string_view record) {
    const Checked found = check(metadata, record);
    return found == Checked::Right || found == Checked::Wrong;
  });

  MetadataJudgement judgement;
  for (const std::string_view record : kRecords) {
    const Checked found = check(metadata, record);
    const bool damaged = checked && found != Checked::Right;
    if (record == kConfigurationMetadata) {
      if (checked)
        judgement.configuration = damaged ? MetadataCheck::Damaged : MetadataCheck::Right;
      if (found == Checked::Without && !checked)
        judgement.configuration = check_text(metadata.at(std::string{record}));
    } else if (damaged) {
      judgement.damage =
          fmt::format("metadata {}: {}", record,
                      found == Checked::Missing ? "missing" : "its checksum is wrong");
    }
  }

  return judgement;
}

}  // namespace abbe::daemon::recording
