// Reads recordings with the public libraries and prints what they saw as JSON.
//   node verify.mjs whole FILE            every message decoded by its recorded schema, through the indexes and as a stream
//   node verify.mjs cuts FILE FROM STEP   the file cut at FROM, FROM + STEP, ... to its end: messages a stream reader gives
//   node verify.mjs parts FILE...         unfinished files: messages a stream reader gives
import { open, readFile } from "node:fs/promises";
import { parseIDL } from "@foxglove/omgidl-parser";
import { MessageReader } from "@foxglove/omgidl-serialization";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";

const plain = (_key, value) => {
  if (typeof value === "bigint") return value.toString();
  return ArrayBuffer.isView(value) ? Array.from(value, (x) => (typeof x === "bigint" ? x.toString() : x)) : value;
};

function decoder() {
  const readers = new Map();
  return (schema, data) => {
    if (!readers.has(schema.id)) {
      readers.set(schema.id, new MessageReader(schema.name, parseIDL(new TextDecoder().decode(schema.data))));
    }
    return readers.get(schema.id).readMessage(data);
  };
}

async function indexed(file) {
  const handle = await open(file);
  const readable = {
    size: async () => BigInt((await handle.stat()).size),
    read: async (offset, length) => {
      const bytes = new Uint8Array(Number(length));
      await handle.read(bytes, 0, Number(length), Number(offset));
      return bytes;
    },
  };
  const reader = await McapIndexedReader.Initialize({ readable });
  const decode = decoder();
  const messages = [];
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    const channel = reader.channelsById.get(message.channelId);
    const schema = reader.schemasById.get(channel.schemaId);
    const date = new Date(Number(message.logTime / 1000000n)).toISOString();
    messages.push({
      topic: channel.topic,
      encoding: channel.messageEncoding,
      schema: schema.name,
      schemaEncoding: schema.encoding,
      sequence: message.sequence,
      logTime: message.logTime,
      date,
      value: decode(schema, message.data),
    });
  }
  const metadata = [];
  for await (const entry of reader.readMetadata()) metadata.push({ name: entry.name, entries: Object.fromEntries(entry.metadata) });
  const attachments = [];
  for await (const entry of reader.readAttachments()) {
    attachments.push({ name: entry.name, mediaType: entry.mediaType, content: new TextDecoder().decode(entry.data) });
  }
  await handle.close();
  return { messages, metadata, attachments, statistics: reader.statistics, chunks: reader.chunkIndexes.length };
}

/** Messages of the whole chunks in front of where the bytes end, all checksums checked. */
function stream(bytes) {
  const reader = new McapStreamReader({ validateCrcs: true });
  reader.append(bytes);
  let messages = 0;
  for (let record; (record = reader.nextRecord()); ) messages += record.type === "Message" ? 1 : 0;
  return { messages, done: reader.done() };
}

async function whole(file) {
  return { indexed: await indexed(file), stream: stream(await readFile(file)) };
}

async function cuts(file, from, step) {
  const bytes = await readFile(file);
  const seen = [];
  for (let cut = from; cut <= bytes.length; cut += step) seen.push([cut, stream(bytes.subarray(0, cut)).messages]);
  return seen;
}

async function parts(files) {
  const seen = [];
  for (const file of files) seen.push(stream(await readFile(file)).messages);
  return seen;
}

const [mode, ...rest] = process.argv.slice(2);
const modes = { whole: () => whole(rest[0]), cuts: () => cuts(rest[0], Number(rest[1]), Number(rest[2])), parts: () => parts(rest) };
console.log(JSON.stringify(await modes[mode](), plain));
