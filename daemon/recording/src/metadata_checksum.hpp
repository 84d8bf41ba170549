#pragma once
/// Checksums of the metadata that a replay and an identification read; MCAP itself defines none for
/// metadata records. Each of the three metadata records of abbe has a checksum over its name and
/// all its other entries. Recordings of older versions only have a checksum of the configuration's
/// text.

#include <map>
#include <string>
#include <string_view>

#include "abbe/recording/recording_reader.hpp"

namespace abbe::daemon::recording {

using MetadataEntries = std::map<std::string, std::string>;

/// The entry of each record that contains metadata_sha256() of its other entries.
inline constexpr const char* kChecksum = "entries_sha256";

/// SHA-256 in hex over the record's name and its entries in the order of their names. Each text is
/// preceded by its length as eight bytes, little-endian. The entry kChecksum is left out.
[[nodiscard]] std::string metadata_sha256(std::string_view record, const MetadataEntries& entries);

struct MetadataJudgement {
  MetadataCheck configuration = MetadataCheck::Unchecked;
  /// damage in the records other than the configuration: "metadata abbe.versions: its checksum is
  /// wrong"; empty: none
  std::string damage;
};
[[nodiscard]] MetadataJudgement judge_metadata(
    const std::map<std::string, MetadataEntries>& metadata);

}  // namespace abbe::daemon::recording
