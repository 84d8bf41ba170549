#include "abbe/protocol/can/sdo_client.hpp"

#include <algorithm>

#include "can/sdo_frames.hpp"

namespace abbe::protocol::can {

void SdoClient::start_upload(ObjectId object, HostTime now) noexcept {
  object_ = object;
  upload_ = true;
  attempts_left_ = options_.retries;
  begin(now);
}

void SdoClient::start_download(ObjectId object, std::span<const std::byte> value,
                               HostTime now) noexcept {
  object_ = object;
  upload_ = false;
  attempts_left_ = options_.retries;
  if (value.empty() || value.size() > kMaxSdoBytes) return fail(AbortCode::LengthMismatch, false);
  std::copy(value.begin(), value.end(), buffer_.begin());
  size_ = value.size();
  begin(now);
}

void SdoClient::begin(HostTime now) noexcept {
  state_ = State::Busy;
  phase_ = Phase::Initiate;
  toggle_ = false;
  aborted_by_server_ = false;
  abort_code_ = AbortCode::None;
  announced_.reset();
  sent_ = 0;
  if (upload_) size_ = 0;
  deadline_ = now + options_.timeout;
  send_initiate();
}

void SdoClient::send_initiate() noexcept {
  const auto cob_id = cob::kSdoRequest + node_;
  if (upload_) {
    send(sdo::frame(cob_id, sdo::kUploadInitiateRequest, object_));
  } else if (size_ <= sdo::kExpeditedBytes) {
    send(sdo::expedited(cob_id, sdo::kDownloadInitiateRequest, object_, value()));
  } else {
    const auto size = static_cast<std::uint32_t>(size_);
    send(sdo::frame(cob_id, sdo::kDownloadInitiateRequest | sdo::kSizeGiven, object_, size));
  }
}

void SdoClient::send(const CanFrame& frame) noexcept {
  if (outbox_count_ == outbox_.size()) {  // the caller did not take the frames: the oldest frame is
                                          // dropped
    outbox_head_ = (outbox_head_ + 1) % outbox_.size();
    --outbox_count_;
  }
  outbox_[(outbox_head_ + outbox_count_++) % outbox_.size()] = frame;
}

std::optional<CanFrame> SdoClient::take_frame() noexcept {
  if (outbox_count_ == 0) return std::nullopt;
  const auto frame = outbox_[outbox_head_];
  outbox_head_ = (outbox_head_ + 1) % outbox_.size();
  --outbox_count_;
  return frame;
}

void SdoClient::fail(AbortCode code, bool by_server) noexcept {
  state_ = State::Failed;
  abort_code_ = code;
  aborted_by_server_ = by_server;
}

void SdoClient::abort(AbortCode code) noexcept {
  send(
      sdo::frame(cob::kSdoRequest + node_, sdo::kAbort, object_, static_cast<std::uint32_t>(code)));
  fail(code, false);
}

void SdoClient::on_time(HostTime now) noexcept {
  if (state_ != State::Busy || now < deadline_) return;
  abort(AbortCode::Timeout);
  if (attempts_left_ == 0) return;
  --attempts_left_;
  begin(now);
}

void SdoClient::on_frame(const CanFrame& frame, HostTime now) noexcept {
  if (state_ != State::Busy || !frame.is_standard_data()) return;
  if (frame.id != cob::kSdoResponse + node_ || frame.length != sdo::kFrameBytes) return;
  if (sdo::specifier(frame) == sdo::kAbort) {
    // An abort contains its object. An abort for another object belongs to an earlier transfer.
    if (sdo::object_of(frame) == object_) fail(AbortCode{sdo::code_name(frame)}, true);
    return;
  }

  deadline_ = now + options_.timeout;
  if (phase_ == Phase::Initiate) {
    on_initiate_answer(frame);
  } else if (upload_) {
    on_upload_segment(frame);
  } else {
    on_download_segment(frame);
  }
}

void SdoClient::on_initiate_answer(const CanFrame& frame) noexcept {
  const auto expected = upload_ ? sdo::kUploadInitiateAnswer : sdo::kDownloadInitiateAnswer;
  // Any other frame is a late answer to an earlier attempt. If the server does not answer, the
  // time-out ends the attempt.
  if (sdo::specifier(frame) != expected || sdo::object_of(frame) != object_) return;
  if (upload_) return on_upload_initiated(frame);
  if (size_ <= sdo::kExpeditedBytes) {
    state_ = State::Done;
    return;
  }
  phase_ = Phase::Segments;
  send_segment();
}

void SdoClient::on_upload_initiated(const CanFrame& frame) noexcept {
  if ((frame.byte(0) & sdo::kExpedited) != 0) {
    size_ = sdo::expedited_size(frame);
    std::copy_n(frame.data.begin() + 4, size_, buffer_.begin());
    state_ = State::Done;
    return;
  }
  if ((frame.byte(0) & sdo::kSizeGiven) != 0) announced_ = sdo::code_name(frame);
  if (announced_ && *announced_ > kMaxSdoBytes) return abort(AbortCode::OutOfMemory);
  phase_ = Phase::Segments;
  request_segment();
}

void SdoClient::request_segment() noexcept {
  CanFrame request;
  request.id = cob::kSdoRequest + node_;
  request.length = sdo::kFrameBytes;
  request.data[0] =
      static_cast<std::byte>(sdo::kUploadSegmentRequest | (toggle_ ? sdo::kToggle : 0));
  send(request);
}

void SdoClient::on_upload_segment(const CanFrame& frame) noexcept {
  if (sdo::specifier(frame) != sdo::kUploadSegmentAnswer) return abort(AbortCode::BadCommand);
  if (sdo::toggle(frame) != toggle_) return abort(AbortCode::ToggleBit);
  const auto data = sdo::segment_data(frame);
  if (data.size() > kMaxSdoBytes - size_) return abort(AbortCode::OutOfMemory);
  std::copy(data.begin(), data.end(), buffer_.begin() + static_cast<std::ptrdiff_t>(size_));
  size_ += data.size();
  toggle_ = !toggle_;
  if (!sdo::is_last_segment(frame)) return request_segment();
  if (announced_ && *announced_ != size_) return abort(AbortCode::LengthMismatch);
  state_ = State::Done;
}

void SdoClient::send_segment() noexcept {
  send(sdo::segment(cob::kSdoRequest + node_, toggle_, value().subspan(sent_)));
}

void SdoClient::on_download_segment(const CanFrame& frame) noexcept {
  if (sdo::specifier(frame) != sdo::kDownloadSegmentAnswer) return abort(AbortCode::BadCommand);
  if (sdo::toggle(frame) != toggle_) return abort(AbortCode::ToggleBit);
  toggle_ = !toggle_;
  sent_ = std::min(sent_ + sdo::kSegmentBytes, size_);
  if (sent_ < size_) return send_segment();
  state_ = State::Done;
}

std::optional<std::uint64_t> SdoClient::number() const noexcept {
  if (size_ == 0 || size_ > sizeof(std::uint64_t)) return std::nullopt;
  return load_le<std::uint64_t>(buffer_, 0, size_);
}

}  // namespace abbe::protocol::can
