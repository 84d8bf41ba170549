#include "abbe/sim/recorded_traffic.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <map>

#include "abbe/protocol/can/udp_framing.hpp"
#include "abbe/protocol/ippdme/lines.hpp"
#include "abbe/protocol/mcap/reader.hpp"
#include "abbe/protocol/modbus/read.hpp"
#include "abbe/protocol/raw_bytes_cdr.hpp"
#include "abbe/protocol/usbip/urb.hpp"

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
    for (RecordedDevice& device : devices) {
      // The recorder empties one ring after the other: in the file, sent bytes may precede bytes
      // that were received earlier.
      std::ranges::stable_sort(device.blocks, {}, &RecordedBlock::time);
      device.kind = kind_of(device.blocks);
    }
    return devices;
  }

 private:
  void on_message(const mcap::Message& message) {
    if (std::find(raw_channels_.begin(), raw_channels_.end(), message.channel_id) ==
        raw_channels_.end())
      return;
    const auto raw = protocol::decode_raw_bytes_cdr(message.data);

    if (!raw) return;
    RecordedDevice& device = devices_[std::string(raw->device)];
    device.name = raw->device;
    const bool to_device = raw->direction == protocol::RawBlock::Direction::ToDevice;
    bool& open = open_[device.name];
    if (!open || device.blocks.empty())
      device.blocks.push_back({raw->time, to_device, raw->lost_before != 0, {}});
    auto& bytes = device.blocks.back().bytes;
    bytes.insert(bytes.end(), raw->bytes.begin(), raw->bytes.end());
    open = raw->continued;
  }

  std::vector<std::uint16_t> raw_channels_;
  std::map<std::string, RecordedDevice> devices_;
  std::map<std::string, bool> open_;
};

/// Passes every record of the file, including those in chunks, to `take(opcode, content)`.
void for_each_record(std::span<const std::byte> file, const auto& take) {
  mcap::LinearScan scan(file);
  while (const auto item = scan.next()) {
    if (!item->chunk) {
      take(item->record.opcode, item->record.content);
      continue;
    }
    if (item->chunk->state != mcap::ScannedChunk::State::Whole &&
        item->chunk->state != mcap::ScannedChunk::State::Cut)
      continue;
    mcap::RecordReader records(item->chunk->chunk.records);
    while (const auto record = records.next()) take(record->opcode, record->content);
  }
}

bool is_usbip(std::span<const std::byte> bytes) {
  if (bytes.size() < protocol::usbip::kUrbHeaderSize) return false;
  return protocol::usbip::decode_urb(bytes.first<protocol::usbip::kUrbHeaderSize>()).has_value();
}

bool is_line(std::span<const std::byte> bytes) {
  std::string_view text{reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  text = text.substr(0, text.find("\r\n"));
  return protocol::ippdme::parse_command(text) || protocol::ippdme::parse_response(text);
}

bool is_emscon(std::span<const std::byte> bytes) {
  constexpr std::size_t kHead = 8;
  if (bytes.size() < kHead) return false;
  std::int32_t size = 0;
  std::memcpy(&size, bytes.data(), sizeof size);
  return static_cast<std::size_t>(size) == bytes.size();
}

/// True for blocks of a program that sends lines of text: abbe sends nothing to it.
bool are_lines(std::span<const RecordedBlock> blocks) {
  constexpr auto is_text = [](std::byte b) {
    return (b >= std::byte{' '} && b <= std::byte{'~'}) || b == std::byte{'\t'} ||
           b == std::byte{'\r'} || b == std::byte{'\n'};
  };
  std::size_t text = 0, all = 0;
  for (const RecordedBlock& block : blocks) {
    if (block.to_device && !block.bytes.empty()) return false;
    all += block.bytes.size();
    text += static_cast<std::size_t>(std::ranges::count_if(block.bytes, is_text));
  }
  return 10 * text > 9 * all;  // garbage on a serial line is less than a tenth
}

std::optional<RecordedKind> kind_of_bytes(std::span<const std::byte> bytes) {
  if (is_emscon(bytes)) return RecordedKind::Tracker;
  if (is_usbip(bytes)) return RecordedKind::CounterCard;
  if (protocol::can::DatagramView::parse(bytes)) return RecordedKind::Encoders;
  if (protocol::modbus::decode_request(bytes, protocol::modbus::Transport::Tcp))
    return RecordedKind::ModbusTcp;
  if (protocol::modbus::decode_request(bytes, protocol::modbus::Transport::Rtu))
    return RecordedKind::ModbusRtu;
  if (is_line(bytes)) return RecordedKind::MeasuringMachine;
  return std::nullopt;
}

}  // namespace

RecordedKind kind_of(std::span<const RecordedBlock> blocks) {
  if (are_lines(blocks)) return RecordedKind::Lines;
  for (const bool to_device : {true, false}) {
    for (const RecordedBlock& block : blocks) {
      if (block.to_device != to_device || block.bytes.empty()) continue;
      if (const auto kind = kind_of_bytes(block.bytes)) return *kind;
    }
  }
  return RecordedKind::Tracker;
}

std::string recorded_configuration(std::span<const std::byte> file) {
  constexpr std::string_view kRecord = "abbe.configuration";
  std::string text;
  for_each_record(file, [&](mcap::Opcode opcode, mcap::Bytes content) {
    if (opcode != mcap::Opcode::Metadata) return;
    const auto metadata = mcap::decode<mcap::Metadata>(content);
    if (metadata && metadata->name == kRecord) text = metadata->entries.find("text").value_or("");
  });
  return text;
}

Result<std::vector<RecordedDevice>> read_traffic(std::span<const std::byte> file,
                                                 std::string_view name) {
  if (!mcap::starts_with_magic(file)) return bad_input(fmt::format("{}: not an MCAP file", name));
  TrafficReader reader;
  for_each_record(
      file, [&](mcap::Opcode opcode, mcap::Bytes content) { reader.on_record(opcode, content); });
  auto devices = reader.finish();
  if (devices.empty())
    return bad_input(fmt::format(
        "{}: no raw bytes of a device in this file; record with [recording] raw = true", name));
  return devices;
}

}  // namespace abbe::sim
