#include "abbe/sim/recorded_traffic.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "abbe/protocol/can/udp_framing.hpp"
#include "abbe/protocol/mcap/reader.hpp"
#include "abbe/protocol/raw_bytes_cdr.hpp"

namespace abbe::sim {
namespace {

namespace mcap = protocol::mcap;
constexpr std::string_view kTopic = "abbe/v1/RawBytes";

class TrafficReader {
 public:
  void on_record(mcap::Opcode opcode, mcap::Bytes content) {
    if (opcode == mcap::Opcode::Channel) {
      const auto channel = mcap::decode<mcap::Channel>(content);
      if (channel && channel->topic == kTopic) raw_channels_.push_back(channel->id);
    } else if (opcode == mcap::Opcode::Message) {
      const auto message = mcap::decode<mcap::Message>(content);
      if (message) on_message(*message);
    }
  }

  std::vector<RecordedDevice> finish() {
    std::vector<RecordedDevice> devices;
    for (auto& [name, device] : devices_) devices.push_back(std::move(device));
    for (RecordedDevice& device : devices) device.kind = kind_of(device);
    return devices;
  }

 private:
  void on_message(const mcap::Message& message) {
    if (std::find(raw_channels_.begin(), raw_channels_.end(), message.channel_id) == raw_channels_.end())
      return;
    const auto raw = protocol::decode_raw_bytes_cdr(message.data);
    if (!raw) return;
    RecordedDevice& device = devices_[std::string(raw->device)];
    device.name = raw->device;
    const bool to_device = raw->direction == protocol::RawBlock::Direction::ToDevice;
    bool& open = open_[device.name];
    if (!open || device.blocks.empty()) device.blocks.push_back({raw->time, to_device, {}});
    auto& bytes = device.blocks.back().bytes;
    bytes.insert(bytes.end(), raw->bytes.begin(), raw->bytes.end());
    open = raw->continued;
  }

  static RecordedKind kind_of(const RecordedDevice& device) {
    for (const RecordedBlock& block : device.blocks) {
      if (block.bytes.empty()) continue;
      return protocol::can::DatagramView::parse(block.bytes) ? RecordedKind::Encoders : RecordedKind::Tracker;
    }
    return RecordedKind::Tracker;
  }

  std::vector<std::uint16_t> raw_channels_;
  std::map<std::string, RecordedDevice> devices_;
  std::map<std::string, bool> open_;
};

}  // namespace

Result<std::vector<RecordedDevice>> read_traffic(std::span<const std::byte> file, std::string_view name) {
  if (!mcap::starts_with_magic(file)) return bad_input(fmt::format("{}: not an MCAP file", name));
  TrafficReader reader;
  mcap::LinearScan scan(file);
  while (const auto item = scan.next()) {
    if (!item->chunk) {
      reader.on_record(item->record.opcode, item->record.content);
      continue;
    }
    if (item->chunk->state != mcap::ScannedChunk::State::Whole &&
        item->chunk->state != mcap::ScannedChunk::State::Cut)
      continue;
    mcap::RecordReader records(item->chunk->chunk.records);
    while (const auto record = records.next()) reader.on_record(record->opcode, record->content);
  }
  auto devices = reader.finish();
  if (devices.empty())
    return bad_input(fmt::format("{}: holds no raw bytes of a device ([recording] raw = true)", name));
  return devices;
}

}  // namespace abbe::sim
