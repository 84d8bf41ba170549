#include "abbe/protocol/can/sdo_server.hpp"

#include <algorithm>

#include "can/sdo_frames.hpp"

namespace abbe::protocol::can {

CanFrame SdoServer::abort(ObjectId object, AbortCode code) noexcept {
  transfer_ = Transfer::None;
  return sdo::frame(cob::kSdoResponse + node_, sdo::kAbort, object,
                    static_cast<std::uint32_t>(code));
}

std::optional<CanFrame> SdoServer::on_time(HostTime now) noexcept {
  if (transfer_ == Transfer::None || now < deadline_) return std::nullopt;
  return abort(object_, AbortCode::Timeout);
}

std::optional<CanFrame> SdoServer::on_frame(const CanFrame& frame, HostTime now) noexcept {
  if (!frame.is_standard_data() || frame.id != cob::kSdoRequest + node_) return std::nullopt;
  if (frame.length != sdo::kFrameBytes) return std::nullopt;
  deadline_ = now + timeout_;

  switch (sdo::specifier(frame)) {
    case sdo::kUploadInitiateRequest:
      return start_upload(sdo::object_of(frame));
    case sdo::kDownloadInitiateRequest:
      return start_download(frame, sdo::object_of(frame));
    case sdo::kUploadSegmentRequest:
      return upload_segment(frame);
    case sdo::kDownloadSegmentRequest:
      return download_segment(frame);
    case sdo::kAbort:
      transfer_ = Transfer::None;
      return std::nullopt;
    default:
      return abort(sdo::object_of(frame), AbortCode::BadCommand);
  }
}

CanFrame SdoServer::start_upload(ObjectId object) noexcept {
  transfer_ = Transfer::None;
  object_ = object;
  done_ = 0;
  toggle_ = false;
  const auto code = objects_.read(object, buffer_, size_);
  if (code != AbortCode::None) return abort(object, code);
  const auto cob_id = cob::kSdoResponse + node_;

  if (size_ >= 1 && size_ <= sdo::kExpeditedBytes) {
    return sdo::expedited(cob_id, sdo::kUploadInitiateAnswer, object,
                          std::span{buffer_}.first(size_));
  }

  transfer_ = Transfer::Upload;
  const auto size = static_cast<std::uint32_t>(size_);
  return sdo::frame(cob_id, sdo::kUploadInitiateAnswer | sdo::kSizeGiven, object, size);
}

CanFrame SdoServer::upload_segment(const CanFrame& frame) noexcept {
  if (transfer_ != Transfer::Upload) return abort(object_, AbortCode::BadCommand);
  if (sdo::toggle(frame) != toggle_) return abort(object_, AbortCode::ToggleBit);
  const auto rest = std::span{buffer_}.first(size_).subspan(done_);
  const auto answer = sdo::segment(cob::kSdoResponse + node_, toggle_, rest);
  done_ += std::min(rest.size(), sdo::kSegmentBytes);
  toggle_ = !toggle_;
  if (sdo::is_last_segment(answer)) transfer_ = Transfer::None;
  return answer;
}

CanFrame SdoServer::start_download(const CanFrame& frame, ObjectId object) noexcept {
  transfer_ = Transfer::None;
  object_ = object;
  done_ = 0;
  toggle_ = false;
  announced_.reset();
  auto code = objects_.may_write(object);
  if (code != AbortCode::None) return abort(object, code);

  if ((frame.byte(0) & sdo::kExpedited) != 0) {
    code = objects_.write(object, std::span{frame.data}.subspan(4, sdo::expedited_size(frame)));
    if (code != AbortCode::None) return abort(object, code);
  } else {
    if ((frame.byte(0) & sdo::kSizeGiven) != 0) announced_ = sdo::code_name(frame);
    if (announced_ && *announced_ > kMaxSdoBytes) return abort(object, AbortCode::OutOfMemory);
    transfer_ = Transfer::Download;
  }

  return sdo::frame(cob::kSdoResponse + node_, sdo::kDownloadInitiateAnswer, object);
}

CanFrame SdoServer::download_segment(const CanFrame& frame) noexcept {
  if (transfer_ != Transfer::Download) return abort(object_, AbortCode::BadCommand);
  if (sdo::toggle(frame) != toggle_) return abort(object_, AbortCode::ToggleBit);
  const auto data = sdo::segment_data(frame);
  if (data.size() > kMaxSdoBytes - done_) return abort(object_, AbortCode::OutOfMemory);
  std::copy(data.begin(), data.end(), buffer_.begin() + static_cast<std::ptrdiff_t>(done_));
  done_ += data.size();

  if (sdo::is_last_segment(frame)) {
    if (announced_ && *announced_ != done_) return abort(object_, AbortCode::LengthMismatch);
    const auto code = objects_.write(object_, std::span{buffer_}.first(done_));
    if (code != AbortCode::None) return abort(object_, code);
    transfer_ = Transfer::None;
  }

  CanFrame answer;
  answer.id = cob::kSdoResponse + node_;
  answer.length = sdo::kFrameBytes;
  answer.data[0] =
      static_cast<std::byte>(sdo::kDownloadSegmentAnswer | (toggle_ ? sdo::kToggle : 0));
  toggle_ = !toggle_;

  return answer;
}

}  // namespace abbe::protocol::can
