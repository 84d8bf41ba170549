#pragma once
/// What stands at the front of every recording, before the first chunk: who recorded what with
/// which configuration, the schemas and channels of all streams (so that no chunk depends on
/// another one), and attachments.

#include <span>

#include "abbe/messages/recording_info.hpp"
#include "abbe/protocol/mcap/writer.hpp"

namespace abbe::daemon::recording {

struct PartOf {
  std::uint32_t part = 1;  ///< 1, 2, ... of this recorder's files
  std::string follows;     ///< name of the previous one, empty for the first
};

/// Appends magic to channels, and tells `summary`. `out` must be empty: offsets count from its
/// front.
void append_front(const RecordingInfo& info, const PartOf& part,
                  protocol::mcap::SummaryBuilder& summary, protocol::mcap::Buffer& out);

/// Appends an attachment that will stand at `offset` of the file. The returned entry of the summary
/// views `attachment`.
[[nodiscard]] protocol::mcap::AttachmentIndex append_attachment(
    const RecordingAttachment& attachment, std::uint64_t time_ns, std::uint64_t offset,
    protocol::mcap::Buffer& out);

}  // namespace abbe::daemon::recording
