// node screenshot.mjs PAGE.html OUT.png [PROPERTY]: the specimen of a report page, coloured by a property.
// Environment as for page_test.mjs.
import {createRequire} from "node:module";
import {resolve} from "node:path";
import {pathToFileURL} from "node:url";

const [page_file, out, property = "H"] = process.argv.slice(2);
const {chromium} = createRequire(`${resolve(process.env.VDBGEO_PAGE_MODULES ?? "node_modules")}/`)("playwright-core");
const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update",
         "--disable-sync", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
});
const page = await browser.newPage({viewport: {width: 1100, height: 760}, reducedMotion: "reduce"});
await page.goto(pathToFileURL(resolve(page_file)).href);
await page.waitForSelector("#viewer[data-ready=true]");
await page.getByLabel("Colour by").selectOption(property);
await page.evaluate(() => window.vdbgeo.settled());
await page.locator("#specimen").screenshot({path: out});
await browser.close();
