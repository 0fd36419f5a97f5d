// Reads every message of an MCAP with Foxglove's parsers; prints what it saw as one JSON object.
import { createRequire } from "node:module";
import { readFileSync } from "node:fs";

const require = createRequire(process.cwd() + "/"); // packages of the folder that npm installed to
const { McapIndexedReader } = require("@mcap/core");
const { loadDecompressHandlers } = require("@mcap/support");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");

const file = readFileSync(process.argv[2]);
const readable = {
  size: async () => BigInt(file.length),
  read: async (offset, length) => file.subarray(Number(offset), Number(offset + length)),
};
const reader = await McapIndexedReader.Initialize({
  readable,
  decompressHandlers: await loadDecompressHandlers(),
});

// 64-bit integers as text, typed arrays as plain ones
const plain = (value) => {
  if (typeof value === "bigint") return value.toString();
  if (ArrayBuffer.isView(value)) return Array.from(value, plain);
  if (Array.isArray(value)) return value.map(plain);
  if (value === null || typeof value !== "object") return value;
  return Object.fromEntries(Object.entries(value).map(([key, inner]) => [key, plain(inner)]));
};

const readers = new Map();
const topics = {};
for await (const message of reader.readMessages()) {
  const channel = reader.channelsById.get(message.channelId);
  if (!readers.has(channel.schemaId)) {
    const schema = reader.schemasById.get(channel.schemaId);
    const definition = parse(new TextDecoder().decode(schema.data), { ros2: true });
    readers.set(channel.schemaId, new MessageReader(definition));
  }
  const decoded = plain(readers.get(channel.schemaId).readMessage(message.data));
  const topic = (topics[channel.topic] ??= { count: 0 });
  topic.first ??= decoded;
  topic.last = decoded;
  topic.count += 1;
}

const attachments = {};
for await (const attachment of reader.readAttachments()) {
  attachments[attachment.name] = attachment.data.length;
}
const metadata = {};
for await (const record of reader.readMetadata()) {
  metadata[record.name] = Object.fromEntries(record.metadata);
}
console.log(JSON.stringify({ profile: reader.header.profile, topics, attachments, metadata }));
