#pragma once
/// The front of every recording, before the first chunk: metadata with machine, configuration and
/// versions, the schemas and channels of all streams (so that no chunk depends on another one), and
/// attachments.

#include <span>

#include "abbe/messages/recording_info.hpp"
#include "abbe/protocol/mcap/writer.hpp"

namespace abbe::daemon::recording {

struct PartOf {
  std::uint32_t part = 1;  ///< number of the file within this recorder: 1, 2, ...
  std::string follows;     ///< name of the previous file, empty for the first
};

/// Appends everything from the MCAP magic to the channels to `out`, and adds the index entries to
/// `summary`. `out` must be empty, because offsets in the file count from its beginning.
void append_front(const RecordingInfo& info, const PartOf& part,
                  protocol::mcap::SummaryBuilder& summary, protocol::mcap::Buffer& out);

/// Appends an attachment that will be at `offset` in the file. The returned summary entry refers to
/// the strings of `attachment`.
[[nodiscard]] protocol::mcap::AttachmentIndex append_attachment(
    const RecordingAttachment& attachment, std::uint64_t time_ns, std::uint64_t offset,
    protocol::mcap::Buffer& out);

}  // namespace abbe::daemon::recording
