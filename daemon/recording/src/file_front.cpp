#include "file_front.hpp"

#include <fmt/format.h>

#include <initializer_list>
#include <map>

#include "abbe/base/sha256.hpp"
#include "metadata_checksum.hpp"
#include "streams.hpp"

namespace abbe::daemon::recording {
namespace {

namespace mcap = protocol::mcap;
using Entries = std::vector<std::pair<std::string, std::string>>;

void append_metadata(std::string_view name, Entries entries, mcap::SummaryBuilder& summary,
                     mcap::Buffer& out) {
  entries.emplace_back(kChecksum, metadata_sha256(name, {entries.begin(), entries.end()}));
  mcap::Buffer packed;
  for (const auto& [key, value] : entries) mcap::StringMap::pack(packed, key, value);
  const std::size_t offset = out.size();
  append(out, mcap::Metadata{name, mcap::StringMap{packed}});
  summary.add(mcap::MetadataIndex{offset, out.size() - offset, name});
}

void append_streams(mcap::SummaryBuilder& summary, mcap::Buffer& out) {
  const auto names = stream_names();
  const std::string_view idl = idl_text();
  for (std::size_t i = 0; i < kStreamCount; ++i) {
    const auto id = channel_id(static_cast<Stream>(i));
    const mcap::Schema schema{id, names[i].type, "omgidl", std::as_bytes(std::span{idl})};
    const mcap::Channel channel{id, id, names[i].topic, "cdr", {}};
    append(out, schema);
    append(out, channel);
    summary.add(schema);
    summary.add(channel);
  }
}

}  // namespace

void append_front(const RecordingInfo& info, const PartOf& part, mcap::SummaryBuilder& summary,
                  mcap::Buffer& out) {
  mcap::append_magic(out);
  append(out, mcap::Header{"", "abbe"});
  const Entries recording{{"machine", info.machine},
                          {"utc_offset_ns", fmt::format("{}", info.utc_offset.value.count())},
                          {"speed", fmt::format("{}", info.speed)},
                          {"part", fmt::format("{}", part.part)},
                          {"follows", part.follows},
                          {kLogTime, "turn of the hub"}};
  append_metadata(kRecordingMetadata, recording, summary, out);
  append_metadata(kConfigurationMetadata,
                  {{"text", info.configuration}, {"sha256", sha256_hex(info.configuration)}},
                  summary, out);
  append_metadata(kVersionsMetadata, info.versions, summary, out);
  append_streams(summary, out);
}

mcap::AttachmentIndex append_attachment(const RecordingAttachment& attachment,
                                        std::uint64_t time_ns, std::uint64_t offset,
                                        mcap::Buffer& out) {
  const std::size_t before = out.size();
  append(out, mcap::Attachment{time_ns, time_ns, attachment.name, attachment.media_type,
                               std::as_bytes(std::span{attachment.content})});
  return {offset,          out.size() - before,  time_ns, time_ns, attachment.content.size(),
          attachment.name, attachment.media_type};
}

}  // namespace abbe::daemon::recording
