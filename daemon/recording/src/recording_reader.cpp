#include "abbe/recording/recording_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <iterator>
#include <list>
#include <utility>

#include "abbe/base/sha256.hpp"
#include "abbe/protocol/raw_bytes_cdr.hpp"
#include "abbe/result/try.hpp"
#include "metadata_checksum.hpp"
#include "recorded_bytes.hpp"
#include "recording_contents.hpp"
#include "sample_messages.hpp"
#include "streams.hpp"

namespace abbe::daemon {

namespace mcap = protocol::mcap;
using recording::Contents;
using recording::ReadableChunk;

namespace {

template <class T>
bool parse(std::string_view text, T& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size();
}

/// The description of the recording; nullopt if `contents` does not have the metadata of a
/// recording of abbe.
std::optional<RecordingInfo> info_of(const Contents& contents) {
  const auto text = [&](std::string_view record, std::string_view key) -> std::string {
    const auto entries = contents.metadata.find(std::string(record));
    if (entries == contents.metadata.end()) return {};
    const auto value = entries->second.find(std::string(key));
    return value == entries->second.end() ? std::string{} : value->second;
  };

  RecordingInfo info;
  std::int64_t utc_offset_ns = 0;
  if (!parse(text(recording::kRecordingMetadata, "utc_offset_ns"), utc_offset_ns))
    return std::nullopt;
  if (!parse(text(recording::kRecordingMetadata, "speed"), info.speed)) return std::nullopt;
  info.utc_offset.value = std::chrono::nanoseconds{utc_offset_ns};
  info.machine = text(recording::kRecordingMetadata, "machine");
  info.configuration = text(recording::kConfigurationMetadata, "text");
  const auto versions = contents.metadata.find(std::string(recording::kVersionsMetadata));
  if (versions != contents.metadata.end())
    info.versions.assign(versions->second.begin(), versions->second.end());
  std::erase_if(info.versions,
                [](const auto& entry) { return entry.first == recording::kChecksum; });

  return info;
}

/// Host time of a UTC date in the file. Unsigned arithmetic wraps around for impossible dates, so
/// that damaged bytes cause no undefined behaviour.
protocol::HostTime host_time(std::uint64_t utc_ns, protocol::UtcOffset offset) {
  const std::uint64_t host_ns = utc_ns - static_cast<std::uint64_t>(offset.value.count());
  return protocol::HostTime{std::chrono::nanoseconds{static_cast<std::int64_t>(host_ns)}};
}

template <class Message, class Take>
bool deliver_as(const RecordedMessage& message, const Take& take) {
  if (!take) return true;
  const auto decoded = decode<Message>(message.payload);
  if (!decoded) return false;
  take(recording::sample_of(*decoded), decoded->device());
  return true;
}

bool deliver_raw(const RecordedMessage& message, const RecordingSink& sink) {
  if (!sink.raw_block) return true;
  const auto decoded = protocol::decode_raw_bytes_cdr(message.payload);
  if (!decoded) return false;
  protocol::RawBlock block;
  protocol::to_raw_block(*decoded, block);
  sink.raw_block(block, decoded->device);
  return true;
}

bool deliver_event(const RecordedMessage& message, const RecordingSink& sink) {
  if (!sink.calibration_event) return true;
  const auto decoded = decode<v1::CalibrationEvent>(message.payload);
  if (!decoded) return false;
  sink.calibration_event(*decoded);
  return true;
}

}  // namespace

bool deliver(const RecordedMessage& message, const RecordingSink& sink) {
  const std::string_view topic = message.topic;
  if (topic == topic_name<v1::AxisSample>())
    return deliver_as<v1::AxisSample>(message, sink.axis_sample);
  if (topic == topic_name<v1::TrackerPoint>())
    return deliver_as<v1::TrackerPoint>(message, sink.tracker_point);
  if (topic == topic_name<v1::RawBytes>()) return deliver_raw(message, sink);

  if (topic == topic_name<v1::EnvironmentSample>()) {
    return deliver_as<v1::EnvironmentSample>(message, sink.environment);
  }

  if (topic == topic_name<v1::ProbeTrigger>())
    return deliver_as<v1::ProbeTrigger>(message, sink.probe_trigger);
  if (topic == topic_name<v1::TouchScan>())
    return deliver_as<v1::TouchScan>(message, sink.touch_scan);
  if (topic == topic_name<v1::CalibrationEvent>()) return deliver_event(message, sink);

  return true;
}

// --- The file

struct RecordingReader::State {
  std::unique_ptr<recording::RecordedBytes> file;
  Contents contents;
  RecordingInfo info;
  MetadataCheck configuration;
  bool log_time_is_cycle;  ///< false: log_time is the instant that a message describes
};

namespace {

bool log_time_is_cycle(const Contents& contents) {
  const auto entries = contents.metadata.find(std::string(recording::kRecordingMetadata));
  return entries != contents.metadata.end() && entries->second.contains(recording::kLogTime);
}

}  // namespace

namespace {

bool begins_with_magic(const recording::RecordedBytes& file) {
  std::array<std::byte, mcap::kMagic.size()> magic{};
  return file.size() >= magic.size() && file.read(0, magic) && mcap::starts_with_magic(magic);
}

}  // namespace

Result<RecordingReader> RecordingReader::open(const std::filesystem::path& path,
                                              const std::function<bool()>& stopped) {
  auto file = recording::RecordedBytes::open(path);
  ABBE_TRY(file);
  if (!begins_with_magic(**file)) {
    return fail(ErrorCode::BadInput,
                fmt::format("read {}: is not an MCAP file: it does not begin with the MCAP magic",
                            path.string()));
  }

  Contents contents = recording::contents_of(**file, stopped);
  if (stopped && stopped())
    return fail(ErrorCode::DataInsufficient,
                fmt::format("read {}: stopped before its end", path.string()));
  ABBE_TRY((*file)->intact());
  if (contents.messages == 0 && !contents.compression.empty())
    return fail(ErrorCode::BadInput,
                fmt::format("read {}: its chunks are compressed with {}, which is not supported: "
                            "write it again without compression (mcap decompress)",
                            path.string(), contents.compression));
  const auto info = info_of(contents);
  if (!info) {
    return fail(
        ErrorCode::BadInput,
        fmt::format("read {}: no metadata \"{}\": not recorded by abbe, or truncated at its front",
                    path.string(), recording::kRecordingMetadata));
  }

  const bool cycles = log_time_is_cycle(contents);
  const auto metadata = recording::judge_metadata(contents.metadata);
  if (!metadata.damage.empty()) contents.losses.push_back({0, 0, metadata.damage});

  return RecordingReader{std::make_unique<State>(
      State{std::move(*file), std::move(contents), *info, metadata.configuration, cycles})};
}

RecordingReader::RecordingReader(std::unique_ptr<State> state) : state_(std::move(state)) {}
RecordingReader::~RecordingReader() = default;
RecordingReader::RecordingReader(RecordingReader&&) noexcept = default;
RecordingReader& RecordingReader::operator=(RecordingReader&&) noexcept = default;

const RecordingInfo& RecordingReader::info() const noexcept {
  return state_->info;
}
const std::vector<RecordingAttachment>& RecordingReader::attachments() const noexcept {
  return state_->contents.attachments;
}
const std::map<std::string, std::map<std::string, std::string>>& RecordingReader::metadata()
    const noexcept {
  return state_->contents.metadata;
}
bool RecordingReader::closed_cleanly() const noexcept {
  return state_->contents.closed_cleanly;
}
std::span<const RecordingLoss> RecordingReader::losses() const noexcept {
  return state_->contents.losses;
}
MetadataCheck RecordingReader::configuration_check() const noexcept {
  return state_->configuration;
}
std::string RecordingReader::damage() const {
  const auto inside = [](const RecordingLoss& loss) { return loss.inside; };
  const auto first = std::ranges::find_if(losses(), inside);
  if (first == losses().end()) return {};
  const auto more = std::ranges::count_if(losses(), inside) - 1;
  return fmt::format("the recording is damaged: {}{}", first->what,
                     more > 0 ? fmt::format(" (and {} more places)", more) : "");
}
std::uint64_t RecordingReader::message_count() const noexcept {
  return state_->contents.messages;
}

std::optional<std::pair<protocol::HostTime, protocol::HostTime>> RecordingReader::time_range()
    const noexcept {
  const auto& chunks = state_->contents.chunks;
  if (chunks.empty()) return std::nullopt;
  const auto last = std::ranges::max_element(chunks, {}, &ReadableChunk::last_time_ns);
  const auto offset = state_->info.utc_offset;
  return std::pair{host_time(chunks.front().earliest_ns, offset),
                   host_time(last->last_time_ns, offset)};
}

std::string RecordingReader::sha256() const {
  constexpr std::uint64_t kPiece = std::uint64_t{1} << 20;
  Sha256 hash;
  recording::ByteWindow window(*state_->file);
  for (std::uint64_t at = 0; at < window.file_size(); at += kPiece)
    if (const auto bytes = window.at(at, kPiece)) hash.update(*bytes);
  return hash.hex();
}

Result<void> RecordingReader::intact() const {
  return state_->file->intact();
}

std::uint64_t RecordingReader::read(const RecordingSink& sink) const {
  std::uint64_t undecodable = 0;
  Cursor cursor = messages();
  while (const auto message = cursor.next()) {
    if (!deliver(*message, sink)) ++undecodable;
  }
  return undecodable;
}

// --- Messages by time

/// Position in the messages of all chunks. Chunks overlap in time, because the recorder writes one
/// stream after the other. The cursor opens chunks in file order and delivers a message once no
/// unopened chunk can contain an earlier message.
struct RecordingReader::Cursor::State {
  struct OpenChunk {
    std::vector<std::byte> bytes;
    std::uint64_t left = 0;  ///< number of messages that are not delivered yet
  };
  struct OpenMessage {
    mcap::Message message;  ///< views into the bytes of the chunk
    std::uint64_t number;   ///< number in the order of recording
    std::list<OpenChunk>::iterator chunk;
  };

  const RecordingReader::State* recording = nullptr;
  std::size_t next_chunk = 0;
  std::list<OpenChunk> chunks;
  std::vector<std::byte> spare;   ///< memory of a chunk whose messages are delivered; it is reused
  std::vector<OpenMessage> open;  ///< messages of opened chunks, ordered by time
  std::size_t given = 0;          ///< the first `given` messages of `open` are delivered
  std::uint64_t given_in_all = 0, opened_in_all = 0;
  std::map<std::uint16_t, std::uint64_t> latest_ns;  ///< time of the latest message, by channel

  [[nodiscard]] bool must_open_chunk() const {
    const auto& all = recording->contents.chunks;
    if (next_chunk == all.size()) return false;
    return given == open.size() || open[given].message.log_time_ns >= all[next_chunk].earliest_ns;
  }
  void forget_given();
  [[nodiscard]] bool open_chunk();
  void take_messages(std::list<OpenChunk>::iterator chunk);
};

/// Drops the delivered messages, and the chunks that have no others.
void RecordingReader::Cursor::State::forget_given() {
  for (std::size_t i = 0; i < given; ++i) {
    const auto chunk = open[i].chunk;
    if (--chunk->left > 0) continue;
    spare = std::move(chunk->bytes);
    chunks.erase(chunk);
  }
  open.erase(open.begin(), open.begin() + static_cast<std::ptrdiff_t>(given));
  given = 0;
}

void RecordingReader::Cursor::State::take_messages(std::list<OpenChunk>::iterator chunk) {
  mcap::MessageReader messages{chunk->bytes};
  while (auto message = messages.next()) {
    if (!recording->log_time_is_cycle) message->publish_time_ns = message->log_time_ns;
    std::uint64_t& latest = latest_ns[message->channel_id];
    latest = message->log_time_ns = std::max(message->log_time_ns, latest);
    open.push_back({*message, opened_in_all++, chunk});
    ++chunk->left;
  }
}

/// False if the chunk cannot be read any more.
bool RecordingReader::Cursor::State::open_chunk() {
  const auto earlier = [](const OpenMessage& a, const OpenMessage& b) {
    return a.message.log_time_ns != b.message.log_time_ns
               ? a.message.log_time_ns < b.message.log_time_ns
               : a.number < b.number;
  };

  forget_given();
  const auto before = static_cast<std::ptrdiff_t>(open.size());
  const ReadableChunk& wanted = recording->contents.chunks[next_chunk++];
  chunks.push_back({std::move(spare), 0});
  const auto chunk = std::prev(chunks.end());
  chunk->bytes.resize(wanted.size);
  if (!recording->file->read(wanted.offset, chunk->bytes)) return false;
  take_messages(chunk);
  if (chunk->left != wanted.messages) return recording->file->mark_changed(), false;

  const auto fresh = open.begin() + before;
  if (!std::is_sorted(fresh, open.end(), earlier)) std::sort(fresh, open.end(), earlier);
  std::inplace_merge(open.begin(), fresh, open.end(), earlier);
  return true;
}

RecordingReader::Cursor RecordingReader::messages() const {
  auto state = std::make_unique<Cursor::State>();
  state->recording = state_.get();
  return Cursor{std::move(state)};
}

RecordingReader::Cursor::Cursor(std::unique_ptr<State> state) : state_(std::move(state)) {}
RecordingReader::Cursor::~Cursor() = default;
RecordingReader::Cursor::Cursor(Cursor&&) noexcept = default;
RecordingReader::Cursor& RecordingReader::Cursor::operator=(Cursor&&) noexcept = default;

std::optional<RecordedMessage> RecordingReader::Cursor::next() {
  State& s = *state_;
  while (s.must_open_chunk()) {
    if (s.open_chunk()) continue;
    s.next_chunk = s.recording->contents.chunks.size();
    s.given = s.open.size();
  }
  if (s.given == s.open.size()) return std::nullopt;
  const mcap::Message& message = s.open[s.given++].message;
  ++s.given_in_all;
  const auto topic = s.recording->contents.topics.find(message.channel_id);
  return RecordedMessage{
      topic == s.recording->contents.topics.end() ? std::string_view{} : topic->second,
      host_time(message.log_time_ns, s.recording->info.utc_offset),
      host_time(message.publish_time_ns, s.recording->info.utc_offset), message.data};
}

double RecordingReader::Cursor::progress() const noexcept {
  const std::uint64_t all = state_->recording->contents.messages;
  return all == 0 ? 1.0 : static_cast<double>(state_->given_in_all) / static_cast<double>(all);
}

}  // namespace abbe::daemon
