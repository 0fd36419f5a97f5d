// Opens a page in Chromium; prints what it asked for and complained of as one JSON object.
// node look.js URL PICTURE SECONDS CHROMIUM
import { createRequire } from "node:module";

const require = createRequire(process.cwd() + "/"); // packages of the folder that npm installed to
const { chromium } = require("playwright-core");
const [url, picture, seconds, executablePath] = process.argv.slice(2);

const browser = await chromium.launch({
  executablePath,
  args: [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
  ],
});
const page = await browser.newPage({ viewport: { width: 1400, height: 900 } });
const errors = [];
const requests = [];
page.on("console", (message) => message.type() === "error" && errors.push(message.text()));
page.on("pageerror", (error) => errors.push(String(error)));
// What the page's own policy refuses never leaves the browser.
page.on("requestfailed", (request) => {
  if (request.failure().errorText !== "csp") requests.push(request.url().slice(0, 200));
});
page.on("response", (response) => requests.push(response.url().slice(0, 200)));
await page.goto(url);
await page.waitForTimeout(1000 * Number(seconds));
await page.screenshot({ path: picture });
const title = await page.title();
await browser.close();
console.log(JSON.stringify({ title, errors, requests }));
