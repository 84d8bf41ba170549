// Any bytes as an MCAP file: the summary, the linear scan, every record it yields and every message
// of every chunk. Any bytes as a RawBytes payload: what decodes encodes to bytes that decode to the
// same. libFuzzer: -max_len=2048

#include <cstdint>
#include <cstdlib>
#include <vector>

#include "abbe/protocol/mcap/reader.hpp"
#include "abbe/protocol/mcap/writer.hpp"
#include "abbe/protocol/raw_bytes_cdr.hpp"

namespace {

using namespace abbe::protocol;

void require(bool promise) {
  if (!promise) std::abort();
}

template <class T>
void round_trip(mcap::Bytes content) {
  const auto record = mcap::decode<T>(content);
  if (!record) return;
  mcap::Buffer once;
  append(once, *record);
  const auto again = mcap::decode<T>(mcap::Bytes{once}.subspan(mcap::kRecordHeadSize));
  require(again.has_value());
  mcap::Buffer twice;
  append(twice, *again);
  require(once == twice);
}

void round_trip_as_every_kind(mcap::Bytes content) {
  round_trip<mcap::Header>(content);
  round_trip<mcap::Footer>(content);
  round_trip<mcap::Schema>(content);
  round_trip<mcap::Channel>(content);
  round_trip<mcap::Message>(content);
  round_trip<mcap::MessageIndex>(content);
  round_trip<mcap::ChunkIndex>(content);
  round_trip<mcap::Attachment>(content);
  round_trip<mcap::AttachmentIndex>(content);
  round_trip<mcap::Statistics>(content);
  round_trip<mcap::Metadata>(content);
  round_trip<mcap::MetadataIndex>(content);
  round_trip<mcap::SummaryOffset>(content);
  round_trip<mcap::DataEnd>(content);
}

void walk(mcap::Bytes records) {
  mcap::MessageReader messages{records};
  while (const auto message = messages.next()) {
    const auto raw = decode_raw_bytes_cdr(message->data);
    if (!raw) continue;
    std::vector<std::byte> out(kMaxRawBytesCdrSize);
    const auto size = encode_cdr(*raw, out);
    require(size.has_value());
    const auto again = decode_raw_bytes_cdr(std::span{out}.first(*size));
    require(again && again->device == raw->device && again->bytes.size() == raw->bytes.size());
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const mcap::Bytes file = std::as_bytes(std::span{data, size});
  if (const auto summary = mcap::read_summary(file)) {
    for (const auto& index : summary->chunks) {
      if (const auto chunk = mcap::chunk_at(file, index.chunk_start)) walk(chunk->chunk.records);
    }
  }

  mcap::LinearScan scan{file};
  while (const auto item = scan.next()) {
    if (item->chunk)
      walk(item->chunk->chunk.records);
    else
      round_trip_as_every_kind(item->record.content);
  }

  require(scan.whole_until() <= size);
  walk(file);
  if (const auto raw = decode_raw_bytes_cdr(file))
    require(raw->bytes.size() <= RawBlock::kCapacity);

  return 0;
}
